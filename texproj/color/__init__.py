"""Projecting photos onto the surface and blending them."""
