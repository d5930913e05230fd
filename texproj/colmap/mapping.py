"""Incremental structure from motion by COLMAP (Schoenberger and Frahm, "Structure-from-motion
revisited", CVPR 2016), with what a handful of photos needs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from texproj.colmap.database import SEED
from texproj.colmap.messages import Model, Task

FEW = 5
"""Photos up to which less is asked of a beginning and of each photo."""
FREED_FROM = 4
"""Photos of one lens from which its principal point is solved too ..."""
CENTER_SIGMA = 0.02
"""... with this deviation from the middle as a prior, widths, and kept if ..."""
CLEAR_GAIN = 4.0
"""... chi-square gains so much more than the prior loses: what two more unknowns must bring by
Akaike's criterion; ..."""
CORRELATED = 10.0
"""... so many residuals share an error. Solved for 4 - 11 photos of two scenes whose lenses are off
center by .7 and 2.5 % of the width, all cameras came nearer to the truth, from 1.2 - 1.6 px to
.2 - .9 px of about 3000."""


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
    freed = [with_principal_points(model, task) for model in found.values()]
    models = [_model(model, rows, task) for model in freed]
    return tuple(sorted(models, key=lambda m: (-len(m.photos), -len(m.points))))


def _options(task: Task, calibrated: set[int]) -> Any:
    options = pycolmap.IncrementalPipelineOptions()
    options.image_names = list(task.keys)
    options.min_model_size = 3
    options.extract_colors = False
    options.num_threads = 1  # with more the same photos now and then give another frame
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


def with_principal_points(model: Any, task: Task) -> Any:
    """The model with solved principal points where the photos tell them clearly."""
    images = _placed(model)
    calibrated = {key for key, lens in zip(task.keys, task.lens_of, strict=True)
                  if task.lenses[lens].intrinsics is not None}  # fmt: skip
    numbers = Counter(image.camera_id for image in images if image.name not in calibrated)
    many = {camera for camera, number in numbers.items() if number >= FREED_FROM}
    if not many:
        return model
    held, freed = _adjusted(model, many, False), _adjusted(model, many, True)
    residuals = 2 * freed.compute_num_observations()
    gain = residuals * (_cost(held) / _cost(freed) - 1) / CORRELATED
    shift2 = sum(_shift2(freed.cameras[camera]) for camera in many)
    return freed if gain - shift2 / CENTER_SIGMA**2 > CLEAR_GAIN else model


def _adjusted(model: Any, many: set[int], free_center: bool) -> Any:
    """The model after a last bundle adjustment in which the lenses of `many` photos may change."""
    model = pycolmap.Reconstruction(model)
    config = pycolmap.BundleAdjustmentConfig()
    for image in model.reg_image_ids():
        config.add_image(image)
    for camera in set(model.cameras) - many:
        config.set_constant_cam_intrinsics(camera)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_principal_point = free_center
    options.print_summary = False
    options.ceres.solver_options.num_threads = 1
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    model.update_point_3d_errors()
    return model


def _cost(model: Any) -> float:
    """Sum of squared reprojection errors, each point's mean taken for all its sightings."""
    return sum(point.error**2 * point.track.length() for point in model.points3D.values())


def _shift2(camera: Any) -> float:
    """Squared distance of the principal point from the middle, widths."""
    x = camera.principal_point_x - camera.width / 2
    y = camera.principal_point_y - camera.height / 2
    return float((x**2 + y**2) / camera.width**2)


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
