"""Absolute color from a photo of a color chart."""
