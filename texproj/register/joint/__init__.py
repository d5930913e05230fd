"""All photos together."""
