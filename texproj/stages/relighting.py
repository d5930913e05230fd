"""Pictures of the recovered surface in a light that somebody asks for: out/relit.png, or a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from texproj.appearance.light.color_temperature import rgb_of_kelvin
from texproj.appearance.relight import (
    Development,
    Environment,
    Illumination,
    Lamp,
    Lens,
    LitSurface,
    Sun,
    ToneName,
    check_tracer,
    exposure_of_ev,
    overcast,
    pictures_through,
    relit_pictures,
    traced_pictures,
)
from texproj.appearance.relight.tone import ev_of_exposure, metered
from texproj.arrays import Bytes, Doubles, Floats
from texproj.camera import Camera
from texproj.errors import InputError, UsageError, nearest_name
from texproj.files import staging
from texproj.formats.environments import read_environment
from texproj.formats.models import read_model
from texproj.formats.models.read_values import read_values
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.project import Project
from texproj.report.pictures import Front, around, on_backdrop
from texproj.stages.appearance_files import MODEL_GLB
from texproj.stages.appearing import STAGE as APPEARANCE
from texproj.stages.appearing import appearance_freshness
from texproj.stages.bench import Workbench
from texproj.stages.coloring import STAGE as COLOR
from texproj.stages.film_path import film_path
from texproj.stages.fronts import front
from texproj.stages.lighting import PLY
from texproj.stages.outcomes import Tally
from texproj.stages.photographed_light import SKY_LUX, SUN_LUX, photographed
from texproj.stages.progress import Progress, silent
from texproj.stages.turning import (
    Film,
    TurntableOptions,
    need_same_mesh,
    replace_record,
    write_film,
)
from texproj.standing import METRES

STAGE = "relight"
PICTURE = "relit"
LAMP_LUX = 1_000.0
"""Of a lamp at the middle of the piece."""
KELVIN = 1000, 25000
LENSES = 0.5, 64
"""Numbers of apertures that have been made."""
TAKEN_FOR = (
    f"photos do not tell how bright their light was: its best-lit side is taken for {SKY_LUX:,.0f}"
    f" lux, {SKY_LUX + SUN_LUX:,.0f} with a sun"
)
NO_SKY, OVERCAST, PHOTOGRAPHED = "none", "overcast", "photographed"


@dataclass(frozen=True)
class Place:
    """Where light comes from, as seen by who looks at the front: heading_deg from behind the viewer
    to the right, height_deg above level; diagonals of the piece's box, None = very far.
    """

    heading_deg: float
    height_deg: float
    diagonals: float | None = None


@dataclass(frozen=True)
class RelightOptions:
    """suns, lamps: where they are; sky: "none", "overcast", "photographed" or a file, None =
    overcast, but none where there are only lamps; kelvin: color of suns and lamps, None = white;
    ev: exposure at ISO 100, None = as a camera meters, or, in the photos' light alone, as theirs;
    tone: the curve, None = filmic, or, there, none; photo: the photo from whose
    camera is looked, None = the front; film: None = one picture; f_number: of a lens, None = all is
    sharp; traced: by the path tracer; turn: options of the film.
    """

    suns: tuple[Place, ...] = ()
    lamps: tuple[Place, ...] = ()
    sky: str | None = None
    kelvin: float | None = None
    ev: float | None = None
    tone: ToneName | None = None
    photo: str | None = None
    film: Film | None = None
    f_number: float | None = None
    traced: bool = False
    turn: TurntableOptions = field(default_factory=TurntableOptions)

    def __post_init__(self) -> None:
        if self.ev is not None and not -20 <= self.ev <= 40:
            raise UsageError(f"--ev {self.ev:g} is not between -20 and 40")
        if self.kelvin is not None and not KELVIN[0] <= self.kelvin <= KELVIN[1]:
            raise UsageError(f"--kelvin {self.kelvin:g} is not between {KELVIN[0]} and {KELVIN[1]}")
        if self.kelvin is not None and not (self.suns or self.lamps):
            raise UsageError(
                "--kelvin is the color of suns and lamps, and there is none; give --sun or --lamp"
            )
        if self.f_number is not None and not LENSES[0] <= self.f_number <= LENSES[1]:
            raise UsageError(f"--lens {self.f_number:g} is not between {LENSES[0]} and {LENSES[1]}")
        if self.film is not None and self.photo is not None:
            raise UsageError("--photo shows one picture; leave out --film")
        for place in (*self.suns, *self.lamps):
            if not (abs(place.heading_deg) <= 360 and abs(place.height_deg) <= 90):
                raise UsageError("a heading is within 360 degrees, a height within 90")
            if place.diagonals is not None and not 0 < place.diagonals <= 1e6:
                raise UsageError("a lamp stands some diagonals of the piece away: 1.5, say")

    @property
    def as_photographed(self) -> bool:
        """Whether the photos' light is the only one, so that pictures are to look like them."""
        return self.sky == PHOTOGRAPHED and not self.suns and not self.lamps

    @property
    def curve(self) -> ToneName:
        return self.tone or ("none" if self.as_photographed else "filmic")


@dataclass(frozen=True)
class RelightOutcome:
    """files: what was written; ev: how it was exposed; notes: what is unusual."""

    files: tuple[Path, ...]
    ev: float
    notes: tuple[str, ...]

    @property
    def tally(self) -> Tally:
        return Tally(0, len(self.files), "written")

    def lines(self) -> Iterator[str]:
        """For people."""
        first, last = self.files[0], self.files[-1]
        yield f"wrote {first}" + (f" to {last.name}" if last != first else "")
        yield f"exposed at EV {self.ev:.1f}"
        for note in self.notes:
            yield f"note: {note}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {"files": [str(p) for p in self.files], "ev": self.ev, "notes": list(self.notes)}


def relight_project(
    bench: Workbench, options: RelightOptions, progress: Progress = silent
) -> RelightOutcome:
    """Render what `appearance` found in another light. Raises InputError where it found nothing
    yet, UsageError, OutputError.
    """
    project = bench.project
    if options.traced:
        check_tracer()
    surface = recovered_surface(project)
    changed = changed_since(project)
    before = front(project, bench.mesh)
    project.check_writable(project.out)
    views, of_frame, notes = _views(bench, options, before)
    light = illumination(project, options, surface, before)
    exposure = _exposure(project, options)
    if options.sky == PHOTOGRAPHED:
        notes += (TAKEN_FOR,)
    shown: list[Bytes] = []
    lit = False
    for layers in _pictures(bench, options, surface, light, views):
        exposure = metered(layers) if exposure is None else exposure
        lit = lit or bool((layers[..., :3] > 0).any())
        shown.append(on_backdrop(Development(exposure, options.curve).developed(layers)))
        progress(STAGE, len(shown), len(views), "")
    if not lit:
        raise UsageError(
            "no light reaches what is seen of the piece; move --sun or --lamp, or add a --sky"
        )
    with staging(project.out) as folder:
        names = _written(folder, [shown[k] for k in of_frame], options)
    replace_record(project, STAGE, names[0].rsplit(".", 1)[-1], names)
    assert exposure is not None  # there is a first picture
    files = tuple(project.out / name for name in names)
    return RelightOutcome(files, ev_of_exposure(exposure), notes + changed)


def _exposure(project: Project, options: RelightOptions) -> float | None:
    """What was asked for, or that of the photos; None = as a camera meters."""
    if options.ev is not None:
        return exposure_of_ev(options.ev)
    return 1 / photographed(project).lux if options.as_photographed else None


def _pictures(
    bench: Workbench, options: RelightOptions, surface: LitSurface, light: Illumination,
    views: Sequence[Camera],
) -> Iterator[Floats]:  # fmt: skip
    """What the cameras see, by what was asked for."""
    lens = _lens(bench, options, views[0]) if options.f_number is not None else None
    if options.traced:
        return traced_pictures(surface, light, views, lens)
    if lens is not None:
        return pictures_through(lens, bench.renderer, surface, light, views)
    return relit_pictures(bench.renderer, surface, light, views)


def _lens(bench: Workbench, options: RelightOptions, view: Camera) -> Lens:
    """Of the size that a camera of full frame has, its focus where the piece is nearest."""
    assert options.f_number is not None
    output = bench.project.settings.output
    depth = view.pose.apply(bench.mesh.vertices)[:, 2]
    seen = depth[depth > 0]
    if not len(seen):
        raise InputError("the piece lies behind the camera; there is nothing to focus on")
    focus = float(np.median(view.pose.apply(bench.mesh.center[None])[:, 2]))
    focus = (float(seen.min()) + max(focus, float(seen.min()))) / 2
    return Lens.of(view, options.f_number, METRES[output.unit], focus)


def changed_since(project: Project) -> tuple[str, ...]:
    """What has changed since `appearance`. Raises InputError if the mesh has."""
    root = project.root
    work = f"`texproj run {root}` and `texproj appearance {root}`"
    need_same_mesh(project, APPEARANCE, "its surface was recovered", work)
    reason = appearance_freshness(project).reason
    return (f"the surface was recovered before: {reason}",) if reason else ()


def recovered_surface(project: Project) -> LitSurface:
    """What `appearance` wrote last: textured where it was asked for textures."""
    outputs = (project.load_record(APPEARANCE) or {}).get("outputs", {})
    path = project.out / PLY
    if PLY not in outputs or not path.is_file():
        raise InputError(
            f"{project.root} has no recovered surface; run `texproj appearance {project.root}`"
        )
    values = read_values(path, ("roughness", "metallic"))
    vertices = read_model(path)
    assert isinstance(vertices, ColoredMesh)
    glb = project.out / MODEL_GLB
    if MODEL_GLB not in outputs or _colored_since(project):
        return LitSurface(vertices, values["roughness"], values["metallic"])
    if outputs[MODEL_GLB] != project.hash_of(glb):
        raise InputError(
            f"{glb} is not what `texproj appearance` wrote; run `texproj appearance"
            f" {project.root} --to texture`"
        )
    model = read_model(glb)
    row = _same_place(model, vertices)
    return LitSurface(model, values["roughness"][row], values["metallic"][row])


def _colored_since(project: Project) -> bool:
    """Whether `color` wrote its own model over the one of `appearance`."""
    made = (project.load_record(COLOR) or {}).get("outputs", {}).get(MODEL_GLB)
    return made is not None and made == project.hash_of(project.out / MODEL_GLB)


def _same_place(model: TexturedMesh | ColoredMesh, vertices: ColoredMesh) -> Any:
    from scipy.spatial import cKDTree  # noqa: PLC0415 - slow to load

    return cKDTree(vertices.vertices).query(model.vertices)[1]


def illumination(
    project: Project, options: RelightOptions, surface: LitSurface, before: Front
) -> Illumination:
    """The lights that were asked for, in the scan's frame."""
    up, level = before
    right = np.cross(up, level)

    def toward(place: Place) -> Doubles:
        heading, height = np.radians((place.heading_deg, place.height_deg))
        across: Doubles = np.cos(heading) * level + np.sin(heading) * right
        return np.cos(height) * across + np.sin(height) * up

    color = np.ones(3) if options.kelvin is None else rgb_of_kelvin(options.kelvin)
    suns = [Sun(toward(place), SUN_LUX * color) for place in options.suns]
    lamps = []
    for place in options.lamps:
        away = (place.diagonals or 1) * surface.mesh.diagonal
        middle = surface.mesh.center + away * toward(place)
        lamps.append(Lamp(middle, LAMP_LUX * away**2 * color))
    sky = options.sky
    if sky is None:
        sky = NO_SKY if lamps and not suns else OVERCAST
    environment = None
    if sky == OVERCAST:
        environment = overcast(up, -level, SKY_LUX)
    elif sky == PHOTOGRAPHED:
        environment, own = photographed(project).shown(up, -level)
        suns += own
    elif sky != NO_SKY:
        environment, direction, light = Environment(_picture(sky), up, -level).parted()
        suns += [] if direction is None or light is None else [Sun(direction, light)]
    if not (suns or lamps or (environment and environment.radiance.any())):
        raise UsageError(
            f"there is no light: the sky is {'dark' if environment else NO_SKY}; give --sun or"
            " --lamp, or another --sky"
        )
    return Illumination(environment, tuple(suns), tuple(lamps))


def _picture(sky: str) -> Floats:
    """The picture that --sky names. Raises UsageError where that is neither a file nor a word."""
    if not Path(sky).is_file():
        words = NO_SKY, OVERCAST, PHOTOGRAPHED
        near = nearest_name(sky.lower(), words)
        raise UsageError(f"--sky {sky!r} is no file, nor a word that is known{near}")
    return read_environment(Path(sky))


def _views(
    bench: Workbench, options: RelightOptions, before: Front
) -> tuple[list[Camera], Sequence[int], tuple[str, ...]]:
    """The cameras to draw, which of them each frame is, and what is unusual about them."""
    size = (options.turn.size, options.turn.size)
    if options.photo is not None:
        return [_of_photo(bench.project, options.photo).reduced(size[0])], [0], ()
    if options.film is None:
        return around(bench.mesh, before, [0.0], size), [0], ()
    path = film_path(bench, before, options.turn.frames)
    angles, of_frame = np.unique(path.angles_deg.round(6), return_inverse=True)
    views = around(bench.mesh, before, angles.tolist(), size)
    return views, of_frame.tolist(), (path.note,) if path.note else ()


def _of_photo(project: Project, name: str) -> Camera:
    records = project.load_cameras()
    if name not in records:
        raise UsageError(f"no photo {name!r}{nearest_name(name, list(records))}")
    camera = records[name].registered_camera
    if camera is None:
        raise InputError(f"{name} is not registered; nobody knows where it was taken from")
    return camera


def _written(folder: Path, frames: Sequence[Bytes], options: RelightOptions) -> list[str]:
    if options.film is not None:
        return write_film(folder, frames, replace(options.turn, film=options.film), PICTURE)
    import cv2  # noqa: PLC0415 - slow to load

    name = f"{PICTURE}.png"
    encoded = cv2.imencode(".png", cv2.cvtColor(frames[0], cv2.COLOR_RGB2BGR))[1]
    (folder / name).write_bytes(encoded.tobytes())
    return [name]
