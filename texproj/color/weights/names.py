"""What the weight of a photo is made of, by name."""

FACTORS = {
    "angle": "Turned towards the camera",
    "density": "Pixels on the surface",
    "border": "Away from the picture's edge",
    "silhouette": "Away from depth discontinuities",
    "mask": "Away from what is masked or in front",
    "exposure": "Neither clipped nor black",
    "focus": "As sharp as the other photos",
    "highlight": "Without a highlight",
    "consistency": "As all photos agree",
    "weight": "All of them together",
}
"""Name of each factor, and what it is 1 for."""
