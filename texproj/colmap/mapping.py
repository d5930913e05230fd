"""Incremental structure from motion by COLMAP (Schoenberger and Frahm, "Structure-from-motion
revisited", CVPR 2016), with what a handful of photos needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from texproj.colmap.database import SEED
from texproj.colmap.messages import Model, Task

FEW = 5
"""Photos up to which less is asked of a beginning and of each photo."""
FREED_FROM = 8
"""Photos of one lens from which its principal point is solved too ..."""
CLEARLY_BETTER = 0.98
"""... and kept if the points' mean error falls to this part of what it was, or below."""
FARTHEST_MIDDLE = 0.05
"""Distance of a principal point from the middle, widths, beyond which it is not believed."""


def mapped(task: Task, calibrated: set[int], told: Callable[[int], None]) -> tuple[Model, ...]:
    """The parts in which the photos hang together, the largest first.

    calibrated: numbers of cameras that stay as they are; told: is called with the photos placed.
    """
    placed = 0

    def next_photo() -> None:
        nonlocal placed
        placed += 1
        told(placed)

    out = Path(task.scratch) / "models"
    out.mkdir(exist_ok=True)
    found = pycolmap.incremental_mapping(
        task.database, task.scratch, str(out), options=_options(task, calibrated),
        initial_image_pair_callback=next_photo, next_image_callback=next_photo,
    )  # fmt: skip
    rows = {key: k for k, key in enumerate(task.keys)}
    freed = [_with_principal_points(model, task) for model in found.values()]
    models = [_model(model, rows, task) for model in freed]
    return tuple(sorted(models, key=lambda m: (-len(m.photos), -len(m.points))))


def _options(task: Task, calibrated: set[int]) -> Any:
    options = pycolmap.IncrementalPipelineOptions()
    options.image_names = list(task.keys)
    options.min_model_size = 3
    options.extract_colors = False
    options.num_threads = task.threads
    options.random_seed = SEED
    options.mapper.random_seed = SEED
    options.triangulation.random_seed = SEED
    options.mapper.init_min_tri_angle = 8
    options.constant_cameras = calibrated
    if len(task.keys) <= FEW:
        options.min_model_size = 2
        options.mapper.init_min_num_inliers = 50
        options.mapper.abs_pose_min_num_inliers = 20
        options.mapper.init_min_tri_angle = 6
    return options


def _with_principal_points(model: Any, task: Task) -> Any:
    """The model with solved principal points if enough photos tell them clearly, else as it is."""
    numbers: dict[int, int] = {}
    for image in _placed(model):
        numbers[image.camera_id] = numbers.get(image.camera_id, 0) + 1
    if min(numbers.values(), default=0) < FREED_FROM:
        return model
    if any(lens.intrinsics is not None for lens in task.lenses):
        return model
    freed = pycolmap.Reconstruction(model)
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_principal_point = True
    options.print_summary = False
    pycolmap.bundle_adjustment(freed, options)
    before, after = (m.compute_mean_reprojection_error() for m in (model, _updated(freed)))
    inside = all(_near_middle(camera) for camera in freed.cameras.values())
    return freed if inside and after <= CLEARLY_BETTER * before else model


def _updated(model: Any) -> Any:
    model.update_point_3d_errors()
    return model


def _near_middle(camera: Any) -> bool:
    gap = (camera.principal_point_x / camera.width - 0.5) ** 2
    gap += ((camera.principal_point_y - camera.height / 2) / camera.width) ** 2
    return bool(gap < FARTHEST_MIDDLE**2)


def _placed(model: Any) -> list[Any]:
    return [model.images[number] for number in sorted(model.reg_image_ids())]


def _four(values: Sequence[float]) -> tuple[float, float, float, float]:
    focal, cx, cy, k1 = map(float, values)
    return focal, cx, cy, k1


def _model(model: Any, rows: dict[str, int], task: Task) -> Model:
    images = _placed(model)
    poses = [image.cam_from_world() for image in images]
    row_of = {image.image_id: k for k, image in enumerate(images)}
    points = [model.points3D[number] for number in sorted(model.points3D)]
    elements = [(k, e) for k, point in enumerate(points) for e in point.track.elements]
    xy = [model.images[e.image_id].points2D[e.point2D_idx].xy for _, e in elements]
    params = []
    for image in images:
        calibrated = task.lenses[task.lens_of[rows[image.name]]].intrinsics is not None
        values = model.cameras[image.camera_id].params
        params.append(None if calibrated else _four(values))
    return Model(
        photos=np.array([rows[image.name] for image in images], np.int64),
        lens_params=tuple(params),
        R=np.array([pose.rotation.matrix() for pose in poses]).reshape(-1, 3, 3),
        t=np.array([pose.translation for pose in poses]).reshape(-1, 3),
        points=np.array([point.xyz for point in points]).reshape(-1, 3),
        error_px=np.array([point.error for point in points], np.float64),
        track=np.array([k for k, _ in elements], np.intp),
        seer=np.array([row_of[e.image_id] for _, e in elements], np.intp),
        xy_px=np.array(xy, np.float32).reshape(-1, 2),
    )
