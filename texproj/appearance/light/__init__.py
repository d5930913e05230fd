"""Sources of light in photometric units, and what arrives from them at a surface."""
