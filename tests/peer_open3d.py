"""Open3D's color from photos, for comparison: run by an interpreter that has Open3D.

    PYTHON tests/peer_open3d.py PROJECT vertices OUT.ply
    PYTHON tests/peer_open3d.py PROJECT albedo OUT.obj UNWRAPPED.obj

vertices: `color_map.run_rigid_optimizer` (Zhou & Koltun 2014) without moving the cameras, which are
right; its lengths in metres are scaled to the mesh. albedo: `project_images_to_albedo`, 4096
texels, on the unwrapping of a given model, so that unwrapping costs it nothing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import open3d as o3d

TEXELS = 4096


def main() -> None:
    project, kind, out = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    photos = json.loads((project / "cameras.json").read_text())["photos"]
    if kind == "vertices":
        vertices(project, photos, out)
    else:
        albedo(project, photos, out, Path(sys.argv[4]))


def vertices(project: Path, photos: list, out: Path) -> None:
    """Colors of vertices; depth images come from Open3D's own ray caster."""
    mesh = o3d.io.read_triangle_mesh(str(next((project / "mesh").glob("*.ply"))))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    size = float(np.linalg.norm(mesh.get_axis_aligned_bounding_box().get_extent()))
    images, cameras = [], []
    for photo in photos:
        camera = _camera(photo)
        rays = scene.create_rays_pinhole(
            o3d.core.Tensor(camera.intrinsic.intrinsic_matrix),
            o3d.core.Tensor(camera.extrinsic), photo["width"], photo["height"],
        )  # fmt: skip
        depth = scene.cast_rays(rays)["t_hit"].numpy()
        depth[~np.isfinite(depth)] = 0
        color = o3d.io.read_image(str(project / "photos" / photo["file"]))
        images.append(o3d.geometry.RGBDImage.create_from_color_and_depth(
            color, o3d.geometry.Image(depth), depth_scale=1.0, depth_trunc=100 * size,
            convert_rgb_to_intensity=False))  # fmt: skip
        cameras.append(camera)
    trajectory = o3d.camera.PinholeCameraTrajectory()
    trajectory.parameters = cameras
    option = o3d.pipelines.color_map.RigidOptimizerOption(
        maximum_iteration=0, maximum_allowable_depth=100 * size,
        depth_threshold_for_visibility_check=0.003 * size,
        depth_threshold_for_discontinuity_check=0.03 * size,
    )  # fmt: skip
    colored = o3d.pipelines.color_map.run_rigid_optimizer(mesh, images, trajectory, option)[0]
    o3d.io.write_triangle_mesh(str(out), colored)


def albedo(project: Path, photos: list, out: Path, unwrapped: Path) -> None:
    """A texture on the first page of the model's unwrapping."""
    mesh = o3d.t.io.read_triangle_mesh(str(unwrapped))
    images = [o3d.t.io.read_image(str(project / "photos" / p["file"])) for p in photos]
    intrinsic = [o3d.core.Tensor(np.array(p["K"], float)) for p in photos]
    extrinsic = [o3d.core.Tensor(_camera(p).extrinsic) for p in photos]
    image = mesh.project_images_to_albedo(images, intrinsic, extrinsic, TEXELS, True)
    page, material = f"{out.stem}_0.png", f"{out.stem}.mtl"
    o3d.t.io.write_image(str(out.with_name(page)), image.to(o3d.core.uint8))
    out.with_name(material).write_text(f"newmtl page\nmap_Kd {page}\n")
    lines = unwrapped.read_text().splitlines()
    kept = [line for line in lines if not line.startswith(("mtllib", "usemtl"))]
    head = [f"mtllib {material}"]
    first = next(i for i, line in enumerate(kept) if line.startswith("f "))
    out.write_text("\n".join([*head, *kept[:first], "usemtl page", *kept[first:]]) + "\n")


def _camera(photo: dict) -> o3d.camera.PinholeCameraParameters:
    camera, extrinsic = o3d.camera.PinholeCameraParameters(), np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = photo["R"], photo["t"]
    K = np.array(photo["K"], float)
    camera.intrinsic = o3d.camera.PinholeCameraIntrinsic(photo["width"], photo["height"], K)
    camera.extrinsic = extrinsic
    return camera


if __name__ == "__main__":
    main()
