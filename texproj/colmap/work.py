"""What of COLMAP's work is done alone for a picture or some pairs, in whatever process."""

from __future__ import annotations

import pickle
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pycolmap

from texproj.colmap.database import FeatureStore
from texproj.colmap.messages import Batch, Features, Matched, Picture, Task

MOST_FEATURES = 6000
PEAK_THRESHOLD = 0.004
"""Contrast of a feature: lower than COLMAP's, since stone in soft light has little."""

pycolmap.logging.logtostderr = True  # or it leaves files in the system's temporary folder
pycolmap.logging.minloglevel = int(pycolmap.logging.WARNING)

_OF_THREAD = threading.local()


def features_of(picture: Picture) -> Features:
    """Keypoints and descriptors of a picture, none where its mask is 0."""
    found, descriptors = _extractor().extract_from_uint8_array(picture.gray)
    points = np.asarray(pycolmap.keypoints_to_matrix(found), np.float32)
    if picture.mask is not None and len(points):
        column, row = points[:, :2].astype(int).T
        height, width = picture.mask.shape
        kept = picture.mask[row.clip(0, height - 1), column.clip(0, width - 1)] > 0
        data = np.asarray(descriptors.data)[kept]
        points, descriptors = points[kept], pycolmap.FeatureDescriptors(descriptors.type, data)
    return Features(picture.key, points, pickle.dumps(descriptors))


def _extractor() -> Any:
    if not hasattr(_OF_THREAD, "extractor"):
        options = pycolmap.FeatureExtractionOptions()
        options.num_threads = 1
        options.sift.max_num_features = MOST_FEATURES
        options.sift.peak_threshold = PEAK_THRESHOLD
        options.sift.first_octave = 0
        _OF_THREAD.extractor = pycolmap.FeatureExtractor.create(options)
    return _OF_THREAD.extractor


def matched(batch: Batch, threads: int) -> Matched:
    """The pairs of a batch, matched and verified in a database of their own."""
    with TemporaryDirectory(prefix="texproj-pairs-") as scratch:
        keys = tuple(features.key for features in batch.features)
        database = str(Path(scratch) / "pairs.db")
        task = Task(database, scratch, keys, batch.lenses, batch.lens_of, threads)
        with FeatureStore(task) as store:
            for features in batch.features:
                store.save_features(features)
        store.match(batch.pairs, Path(scratch) / "pairs.txt")
        with FeatureStore(task) as store:
            return Matched(tuple(map(store.load_match, batch.pairs)))
