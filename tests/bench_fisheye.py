"""Registration and refinement of fisheyes: a real set bent to one, and a wide one that is rendered.

    python tests/bench_fisheye.py SCENE_FOLDER ... [--what bent,wide] [--px 8,60] [--keep DIR]

bent: each photo of the scene resampled through OpenCV's fisheye with strong terms. wide: pictures
of the scene's model (colored here from its photos, drawn ray by ray) from near, 70 degrees to all
sides, with noise. For each, the cameras are moved by so many pixels: by the first number they are
given as registered and refined, by the second they are starts, registered and refined. Errors are
mean distances of vertices that lie in the picture and face it, as in pose_error.py, in pixels.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

import cv2
import numpy as np
from color_runs import color, make_project
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from texproj.formats.meshes import read_mesh
from texproj.formats.models import read_model

TERMS = (0.05, -0.02, 0.004, -0.0006)
ZOOM = 1.2
"""Focal length of the bent photos over that of the originals: their corners are all inside."""
WIDE_SIZE, WIDE_RAD, WIDE_VIEWS, NEARER = (1600, 1200), np.radians(70), 8, 0.4
NOISE = 2.0
"""Standard deviation of 8-bit values in the rendered pictures."""
CENTER_OFF = (0.013, -0.008)
"""Of the principal point, in pictures."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--what", default="bent,wide")
    parser.add_argument("--px", default="8,60")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    near_px, far_px = map(float, given.px.split(","))
    with tempfile.TemporaryDirectory() as temporary:
        root = given.keep or Path(temporary)
        for scene in given.scenes:
            for what in given.what.split(","):
                made = root / f"{scene.name}-{what}"
                truth = (bent if what == "bent" else wide)(scene, made)
                points = facing_points(made)
                print(f"\n{scene.name}, {what}: {len(truth)} photos", flush=True)
                run(made, truth, points, near_px, "registered", ("refine",))
                run(made, truth, points, far_px, "prior", ("register", "refine"))


def run(folder: Path, truth, points, px: float, status: str, commands) -> None:
    """Move the cameras, run the commands, print the errors."""
    moved_ = [moved(entry, points, px) | {"status": status, "method": "import"} for entry in truth]
    save(folder, moved_)
    before = [error_px(a, b, points) for a, b in zip(moved_, truth, strict=True)]
    print(f"  {' + '.join(commands)} from {np.median(before):.1f} px", end="", flush=True)
    for command in commands:
        start = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", "texproj", command, str(folder)], capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        if done.returncode > 1:
            print(f": {done.stdout}{done.stderr}")
            return
        found = {e["file"]: e for e in json.loads((folder / "cameras.json").read_text())["photos"]}
        good = [e for e in truth if found[e["file"]]["status"] == "registered"]
        errors = [error_px(found[e["file"]], e, points) for e in good]
        told = [found[e["file"]]["quality"].get("expected_error_px") for e in good]
        told = [value for value in told if value is not None]
        print(
            f"; {command}: {len(good)} of {len(truth)},"
            f" median {np.median(errors or [np.nan]):.2f}, worst {max(errors, default=np.nan):.2f},"
            f" told {np.median(told or [np.nan]):.2f}, {time.monotonic() - start:.0f} s",
            end="", flush=True,
        )  # fmt: skip
    print()


# --- the sets


def entry(name: str, size, f: float, R, t) -> dict:
    """A fisheye as cameras.json has it."""
    center = [side * (0.5 + off) for side, off in zip(size, CENTER_OFF, strict=True)]
    K = [[f, 0, center[0]], [0, f, center[1]], [0, 0, 1]]
    return {
        "file": name, "width": size[0], "height": size[1], "K": K, "dist": list(TERMS),
        "model": "fisheye", "R": np.asarray(R).tolist(), "t": np.asarray(t).tolist(),
    }  # fmt: skip


def bent(scene: Path, folder: Path) -> list[dict]:
    """The scene's photos through the fisheye, in a project of their own."""
    make_project(scene, folder, every=True)
    truth = []
    for photo in json.loads((folder / "cameras.json").read_text())["photos"]:
        K, size = np.array(photo["K"]), (photo["width"], photo["height"])
        made = entry(photo["file"], size, ZOOM * K[0, 0], photo["R"], photo["t"])
        x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
        ideal = straight(np.stack([x, y], axis=-1).reshape(-1, 2), made)
        dist = np.array(photo.get("dist") or [0.0] * 5)
        xyz = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        at = cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), K, dist)[0].reshape(
            size[1], size[0], 2
        )
        path = folder / "photos" / photo["file"]
        pixels = cv2.imread(str(path))
        path.unlink()
        at = (at - 0.5).astype(np.float32)
        image = cv2.remap(pixels, at, None, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)
        cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        truth.append(made)
    return truth


def wide(scene: Path, folder: Path) -> list[dict]:
    """Pictures of the scene's model from near, in a project of their own."""
    make_project(scene, folder, every=True)
    (folder / "project.toml").write_text("[color]\noccluders = false\n")
    color(folder, "texture")
    model = read_model(folder / "out/model.obj")
    photos = json.loads((folder / "cameras.json").read_text())["photos"]
    target = np.median(model.vertices, axis=0)
    for path in (folder / "photos").iterdir():
        path.unlink()
    caster = Caster(model)
    truth, rng = [], np.random.default_rng(3)
    chosen = photos[:: max(1, len(photos) // WIDE_VIEWS)][:WIDE_VIEWS]
    f = WIDE_SIZE[0] / 2 / (WIDE_RAD * np.polyval([*TERMS[::-1], 1.0], WIDE_RAD**2))
    for number, photo in enumerate(chosen):
        R = np.array(photo["R"])
        center = -R.T @ photo["t"]
        R = turned(rng.normal(0, 0.12, 3)) @ R
        t = -R @ (target + NEARER * (center - target))
        made = entry(f"wide_{number}.png", WIDE_SIZE, float(f), R, t)
        image = caster.picture(made) + rng.normal(0, NOISE, (WIDE_SIZE[1], WIDE_SIZE[0], 3))
        cv2.imwrite(
            str(folder / "photos" / made["file"]), np.round(image).clip(0, 255).astype(np.uint8)
        )
        truth.append(made)
    return truth


class Caster:
    """Pictures of a textured model ray by ray; grey where nothing is seen."""

    def __init__(self, model) -> None:
        self.model, self.scene = model, EmbreeScene()
        self.center = model.vertices.mean(axis=0)
        triangles = (model.vertices - self.center)[model.faces].astype(np.float32)
        TriangleMesh(self.scene, triangles)

    def picture(self, made: dict):
        """(h, w, 3) values, BGR: the mean of four rays a pixel."""
        size = made["width"], made["height"]
        total = np.zeros((size[1], size[0], 3))
        for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
            x, y = np.meshgrid(np.arange(size[0]) + dx, np.arange(size[1]) + dy)
            total += self._seen(made, np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(total.shape)
        return total / 4

    def _seen(self, made: dict, xy):
        R, model = np.array(made["R"]), self.model
        ideal = straight(xy, made)
        out = np.full((len(xy), 3), 40.0)
        known = np.flatnonzero(np.isfinite(ideal).all(axis=1))
        rays = np.concatenate([ideal[known], np.ones((len(known), 1))], axis=1) @ R
        origin = np.tile(-R.T @ made["t"] - self.center, (len(rays), 1)).astype(np.float32)
        hit = self.scene.run(origin, rays.astype(np.float32), output=True)
        face, u, v = hit["primID"], hit["u"], hit["v"]
        on = (face >= 0) & (model.page_of_face[face] == 0)
        weights = np.stack([1 - u - v, u, v], axis=1)[on]
        uv = np.einsum("nc,nck->nk", weights, model.uv[model.uv_faces[face[on]]])
        page = model.pages[0]
        at = np.stack([uv[:, 0] * page.shape[1], (1 - uv[:, 1]) * page.shape[0]], axis=1) - 0.5
        maps = np.zeros((-(-len(at) // 4096), 4096, 2), np.float32)
        maps.reshape(-1, 2)[: len(at)] = at
        colors = cv2.remap(page, maps, None, cv2.INTER_LINEAR).reshape(-1, page.shape[2])[: len(at)]
        out[known[on]] = colors[:, 2::-1]
        return out


# --- the truth's own arithmetic


def straight(xy, made: dict):
    """(n, 2) pixels to (x/z, y/z), by OpenCV."""
    K, D = np.array(made["K"]), np.array(made["dist"])
    return cv2.fisheye.undistortPoints(np.float64(xy)[:, None], K, D[:, None])[:, 0]


def projected(made: dict, points):
    """(n, 2) pixels and (n,) depths, by OpenCV."""
    R, t = np.array(made["R"]), np.array(made["t"])
    xyz = points @ R.T + t
    turn = cv2.Rodrigues(R)[0]
    K, D = np.array(made["K"]), np.array(made["dist"])[:4, None]
    xy = cv2.fisheye.projectPoints(points[:, None], turn, t.reshape(3, 1), K, D)[0][:, 0]
    angle = np.arctan2(np.linalg.norm(xyz[:, :2], axis=1), xyz[:, 2])
    return np.where(angle[:, None] < WIDE_RAD, xy, np.nan), xyz[:, 2]


def facing_points(folder: Path):
    """(n, 6) vertices and normals of the mesh."""
    (path,) = (folder / "mesh").iterdir()
    vertices, faces = read_mesh(path)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals, chosen = (
        np.cross(b - a, c - a),
        np.random.default_rng(0).integers(len(faces), size=4000),
    )
    return np.hstack([(a + b + c)[chosen] / 3, normals[chosen]])


def in_picture(made: dict, points):
    xy, depth = projected(made, points[:, :3])
    center = -np.array(made["R"]).T @ made["t"]
    facing = ((center - points[:, :3]) * points[:, 3:]).sum(axis=1) > 0
    inside = ((xy > 0) & (xy < (made["width"], made["height"]))).all(axis=1)
    return facing & inside & (depth > 0)


def error_px(found: dict, made: dict, points) -> float:
    seen = points[in_picture(made, points)]
    off = projected(found, seen[:, :3])[0] - projected(made, seen[:, :3])[0]
    return float(np.nanmean(np.linalg.norm(off, axis=1)))


def turned(w):
    return cv2.Rodrigues(np.asarray(w, np.float64))[0]


def moved(made: dict, points, px: float) -> dict:
    """The camera off by `px` on average, in a direction that follows from its name."""
    rng = np.random.default_rng(zlib.crc32(made["file"].encode()))
    step, R0, t0 = rng.normal(size=6), np.array(made["R"]), np.array(made["t"])
    middle = R0 @ points[:, :3].mean(axis=0) + t0

    def at(s: float) -> dict:
        dR = turned(step[:3] * s)
        t = dR @ (t0 - middle) + middle + step[3:] * abs(middle[2]) * s
        return dict(made, R=(dR @ R0).tolist(), t=t.tolist())

    s = 1e-3
    for _ in range(30):
        s *= np.clip(px / max(error_px(at(s), made, points), 1e-9), 0.5, 2.0)
    return at(s)


def save(folder: Path, photos) -> None:
    for name in ("work", "out"):
        if (folder / name).exists():
            import shutil

            shutil.rmtree(folder / name)
    content = {"format": "texproj-cameras", "version": 1, "photos": photos}
    (folder / "cameras.json").write_text(json.dumps(content))


if __name__ == "__main__":
    main()
