"""Light that stays beside the camera while the object turns."""
