"""The kinds of models that are written: what each holds, and who read it in the tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ModelKind:
    """files: beside each other in out/; made_from: by the settings' words; colors: what its images
    or vertices hold; accepted: readers of other hands that took what we write.
    """

    name: str
    files: str
    made_from: str
    colors: str
    accepted: str


MODEL_KINDS = (
    ModelKind(
        "glb", "model.glb", "texture, patches, vertices",
        "png, jpeg, webp, ktx2", "validator, three.js",
    ),
    ModelKind(
        "usdz", "model.usdz", "texture, patches", "png, jpeg",
        "usd-core's validators",
    ),
    ModelKind(
        "obj", "model.obj, .mtl, images", "texture, patches",
        "png, tiff, jpeg, webp, exr", "trimesh",
    ),
    ModelKind("ply", "model.ply", "vertices", "8 bits", "trimesh, MeshLab"),
)  # fmt: skip
