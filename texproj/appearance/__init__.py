"""From the light in the photos to the surface itself: reflectance, and the light of the day."""
