"""Make projects/stele again: python tests/make_project.py projects/stele

A stele and the demo's photographer, with six photos that overlap, as somebody takes them who
walks along the front. One photo has picks, one a rough camera; the others have nothing.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from texproj.camera import Camera
from texproj.demo.jpeg import Exif, jpeg
from texproj.demo.light import Lighting
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import painted
from texproj.demo.photographer import Scene, ShotOptions, photograph, set_up
from texproj.demo.picks import picked
from texproj.demo.sensor import Sensor
from texproj.demo.views import COMPACT, View, camera_at, disturbed
from texproj.files import staging, write_atomically
from texproj.formats.cameras import cameras_json
from texproj.formats.correspondences import correspondences_csv
from texproj.formats.models.ply import write_ply
from texproj.mesh import Mesh
from texproj.records import CameraRecord

SEED = 1
LONG_SIDE = 720
FACES = 45_000
TRUE_FACES = 250_000
VIEWS = (
    View(-46, 14, ev=0.2),
    View(-28, 22),
    View(-10, 12, ev=0.3),
    View(8, 24, ev=-0.2),
    View(26, 14),
    View(44, 22, ev=0.2),
)
PICKED, PICKS, PICK_SIGMA_PX = 2, 10, 0.7
ROUGH, ROUGH_PX = 0, 12.0
PAINT = 0.5
"""Share of the paint that is left on a stone that stood outside for long: more shape is seen."""
SETTINGS = """\
# Settings of this project. Every key is optional; `texproj COMMAND --help` lists them all.
mesh = "mesh/scan.ply"
photos = "photos"
"""


def main(folder: Path) -> None:
    """Carve, scan, photograph, pick, and write the folder. Deterministic."""
    made = piece("stele", SEED)
    scan = scanned(made, FACES, 0.0004, SEED)
    scene = set_up(carved(made, TRUE_FACES), painted(SEED, PAINT), Lighting(), gloss=0.3)
    cameras = {}
    for number, view in enumerate(VIEWS):
        rng = np.random.default_rng([SEED, number])
        name = f"IMG_{number + 1:04d}"
        camera = camera_at(view, scan.bounds, LONG_SIDE, rng)
        take(folder, scene, name, view, camera)
        cameras[f"{name}.jpg"] = camera
        if number == PICKED:
            picks = picked(scan, camera, PICKS, PICK_SIGMA_PX, rng)
            path = folder / "correspondences" / f"{name}.csv"
            write_atomically(path, correspondences_csv(picks))
        if number == ROUGH:
            start = disturbed(camera, scan.vertices[::37], ROUGH_PX, rng)
            rough = record(f"{name}.jpg", start, "prior")
            write_atomically(folder / "cameras.json", cameras_json([rough]))
    truth = [record(name, camera, "registered") for name, camera in cameras.items()]
    write_atomically(folder / "truth/cameras.json", cameras_json(truth))
    write_atomically(folder / "project.toml", SETTINGS.encode())
    write_mesh(folder / "mesh/scan.ply", scan)


def take(folder: Path, scene: Scene, name: str, view: View, camera: Camera) -> None:
    """The photo, and the outline of the stone in it."""
    number = int(name[-4:])
    how = ShotOptions(sensor=Sensor(ev=view.ev), seed=SEED * 1000 + number)
    shot = photograph(scene, camera, how)
    encoded = jpeg(shot.pixels, Exif(view.body, view.ev, number, turned=view.upright))
    write_atomically(folder / "photos" / f"{name}.jpg", encoded)
    outline = cv2.imencode(".png", shot.object_mask)[1].tobytes()
    write_atomically(folder / "truth/masks" / f"{name}.png", outline)


def record(name: str, camera: Camera, status: str) -> CameraRecord:
    """An entry of cameras.json."""
    size = camera.width, camera.height
    return CameraRecord(name, *size, camera.intrinsics, camera.pose, status, "import")


def write_mesh(path: Path, mesh: Mesh) -> None:
    """The scan, without colors."""
    with staging(path.parent) as place:
        write_ply(place / path.name, mesh.vertices, mesh.faces, None)


if __name__ == "__main__":
    assert VIEWS[0].body == COMPACT
    main(Path(sys.argv[1]))
