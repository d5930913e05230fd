"""Features and verified pairs of photos in COLMAP's database, which lasts from run to run."""

from __future__ import annotations

import pickle
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pycolmap

from texproj.arrays import Floats, Ints
from texproj.camera import Intrinsics
from texproj.colmap.messages import Batch, Features, Lens, Match, Task
from texproj.solve.retrieval import (
    ALL_WITH_ALL,
    centers_of,
    chosen_pairs,
    training_sample,
    vlad,
)

USUAL_FOCAL = 1.2
"""Focal length where nothing is known, widths of the photo."""
SEED = 0
DESCRIPTORS_EACH = 200
"""Of each photo, for finding typical descriptors."""


class FeatureStore:
    """The database, with the photos of a task in it. Photos are called by their keys there.

    What belongs together is written in one transaction: a process that is killed between two of
    its parts leaves neither.
    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self._db = _opened(Path(task.database))
        with pycolmap.DatabaseTransaction(self._db):
            self._ids = self._entered()

    def __enter__(self) -> FeatureStore:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._db.close()

    def _entered(self) -> dict[str, int]:
        """The photos' numbers in the database; each is entered, its camera as now believed."""
        cameras = self._cameras()
        known = {image.name: image for image in self._db.read_all_images()}
        return {
            key: self._number(key, known, cameras[lens])
            for key, lens in zip(self._task.keys, self._task.lens_of, strict=True)
        }

    def _cameras(self) -> list[tuple[int, int]]:
        """Numbers of camera and rig for each lens; each camera has a rig of its own, as COLMAP
        wants.
        """
        known = {_facts(camera): camera for camera in self._db.read_all_cameras()}
        return [self._camera(camera_of(lens), known) for lens in self._task.lenses]

    def _camera(self, camera: Any, known: dict[Any, Any]) -> tuple[int, int]:
        entered = known.get(_facts(camera))
        if entered is None:
            entered = self._db.read_camera(self._db.write_camera(camera))
            rig = pycolmap.Rig()
            rig.add_ref_sensor(entered.sensor_id)
            self._db.write_rig(rig)
        rig = self._db.read_rig_with_sensor(entered.sensor_id)
        return int(entered.camera_id), int(rig.rig_id)

    def _number(self, key: str, known: dict[str, Any], camera_rig: tuple[int, int]) -> int:
        camera, rig = camera_rig
        frame = pycolmap.Frame()
        frame.rig_id = rig
        image = known.get(key)
        if image is None:
            number = self._db.write_image(pycolmap.Image(name=key, camera_id=camera))
            frame.add_data_id(self._db.read_image(number).data_id)
            self._db.write_frame(frame)
            return int(number)
        if image.camera_id != camera:
            image.camera_id = camera
            frame.frame_id = image.frame_id
            frame.add_data_id(image.data_id)
            self._db.update_frame(frame)  # first, since an image's frame must know its camera
            self._db.update_image(image)
        return int(image.image_id)

    def calibrated_cameras(self) -> set[int]:
        """Numbers of the cameras that stay as they are."""
        pairs = zip(self._cameras(), self._task.lenses, strict=True)
        return {camera for (camera, _), lens in pairs if lens.intrinsics is not None}

    def has_features(self, key: str) -> bool:
        """Whether a photo's features are known."""
        number = self._ids[key]
        return bool(self._db.exists_keypoints(number) and self._db.exists_descriptors(number))

    def save_features(self, found: Features) -> None:
        """Keep a photo's features."""
        number = self._ids[found.key]
        descriptors = pickle.loads(found.descriptors)
        with pycolmap.DatabaseTransaction(self._db):
            self._db.write_keypoints(number, found.points)
            self._db.write_descriptors(number, descriptors)

    def load_features(self, key: str) -> Features:
        """A photo's features."""
        number = self._ids[key]
        points = self._db.read_keypoints(number)
        return Features(key, points, pickle.dumps(self._db.read_descriptors(number)))

    def chosen_pairs(self) -> list[tuple[str, str]]:
        """Keys of the photos that are worth matching."""
        keys, vectors = [key for key in self._task.keys if self.has_features(key)], None
        if len(keys) > ALL_WITH_ALL:
            centers = centers_of(training_sample([self._some(key) for key in keys]))
            vectors = np.stack([vlad(self._all(key), centers) for key in keys])
        return [(keys[i], keys[j]) for i, j in chosen_pairs(len(keys), vectors)]

    def _all(self, key: str) -> Floats:
        return np.asarray(self._db.read_descriptors(self._ids[key]).data, np.float32)

    def _some(self, key: str) -> Floats:
        rows = self._all(key)
        return rows[:: max(1, len(rows) // DESCRIPTORS_EACH)]

    def was_matched(self, a: str, b: str) -> bool:
        """Whether a pair was matched before, with whatever outcome."""
        return bool(self._db.exists_two_view_geometry(self._ids[a], self._ids[b]))

    def match(self, pairs: Sequence[tuple[str, str]], file: Path) -> None:
        """Match pairs and verify them by epipolar geometry. The database must be closed."""
        file.write_text("\n".join(f"{a} {b}" for a, b in pairs) + "\n", encoding="utf-8")
        matching = pycolmap.FeatureMatchingOptions()
        matching.num_threads = self._task.threads
        verifying = pycolmap.TwoViewGeometryOptions()
        verifying.ransac.random_seed = SEED
        pairing = pycolmap.ImportedPairingOptions()
        pairing.match_list_path = str(file)
        pycolmap.match_image_pairs(self._task.database, matching, pairing, verifying)

    def load_match(self, pair: tuple[str, str]) -> Match:
        """What came of matching a pair."""
        ids = [self._ids[key] for key in pair]
        geometry = self._db.read_two_view_geometry(*ids)
        return Match(pair, self._db.read_matches(*ids), pickle.dumps(geometry))

    def save_match(self, match: Match) -> None:
        """Keep what came of matching a pair."""
        ids = [self._ids[key] for key in match.pair]
        geometry = pickle.loads(match.geometry)
        with pycolmap.DatabaseTransaction(self._db):
            self._db.write_matches(*ids, match.rows)
            self._db.write_two_view_geometry(*ids, geometry)

    def batch(self, pairs: Sequence[tuple[str, str]]) -> Batch:
        """What somebody else needs to match pairs."""
        keys = sorted({key for pair in pairs for key in pair}, key=lambda key: self._ids[key])
        lens_of = dict(zip(self._task.keys, self._task.lens_of, strict=True))
        numbers = tuple(lens_of[key] for key in keys)
        features = tuple(map(self.load_features, keys))
        return Batch(features, self._task.lenses, numbers, tuple(pairs))

    def verified(self, pairs: Sequence[tuple[str, str]]) -> tuple[Ints, Ints]:
        """(k, 2) numbers of photos and (k,) how many matches each pair has, pairs with any."""
        row = {number: k for k, number in enumerate(self._ids[key] for key in self._task.keys)}
        wanted = {tuple(sorted((self._ids[a], self._ids[b]))) for a, b in pairs}
        ids, counts = self._db.read_two_view_geometry_num_inliers()
        found = [
            (tuple(sorted(pycolmap.pair_id_to_image_pair(pair))), count)
            for pair, count in zip(ids, counts, strict=True)
        ]
        kept = [(row[a], row[b], n) for (a, b), n in found if n and (a, b) in wanted]
        table = np.array(kept, np.int64).reshape(-1, 3)
        return table[:, :2], table[:, 2]


def _opened(path: Path) -> Any:
    """The database. A damaged one is begun anew: nothing in it cannot be found again."""
    try:
        return pycolmap.Database.open(path)
    except RuntimeError:
        if not _damaged(path):
            raise
        for file in path.parent.glob(f"{path.name}*"):  # with what SQLite keeps beside it
            file.unlink()
        return pycolmap.Database.open(path)


def _damaged(path: Path) -> bool:
    """Whether a file cannot be read as a database, rather than being out of reach or in use."""
    try:
        with closing(sqlite3.connect(path)) as database:
            return bool(database.execute("PRAGMA quick_check").fetchone() != ("ok",))
    except sqlite3.OperationalError:
        return False
    except sqlite3.DatabaseError:
        return True


def _facts(camera: Any) -> tuple[Any, ...]:
    """What makes two cameras of the database the same."""
    params = tuple(float(value) for value in camera.params)
    return camera.model, camera.width, camera.height, params, camera.has_prior_focal_length


def camera_of(lens: Lens) -> Any:
    """COLMAP's camera of a lens: one coefficient to solve, or OpenCV's model as calibrated."""
    if lens.intrinsics is not None:
        model, params = _calibrated(lens.intrinsics)
    else:
        focal = lens.focal_px or USUAL_FOCAL * max(lens.width, lens.height)
        params, model = [focal, lens.width / 2, lens.height / 2, lens.k1], "SIMPLE_RADIAL"
    camera = pycolmap.Camera(model=model, width=lens.width, height=lens.height, params=params)
    camera.has_prior_focal_length = lens.intrinsics is not None or lens.focal_px is not None
    return camera


def _calibrated(k: Intrinsics) -> tuple[str, list[float]]:
    """COLMAP's model of a lens that is known, and its parameters."""
    base = [k.fx, k.fy, k.cx, k.cy]
    if k.is_fisheye:
        k1, k2, k3, k4, p1, p2, s1, s2 = (*k.dist, *(0.0,) * 4)[:8]
        return "THIN_PRISM_FISHEYE", [*base, k1, k2, p1, p2, k3, k4, s1, s2]
    return "FULL_OPENCV", [*base, *(*k.dist, *(0.0,) * 8)[:8]]
