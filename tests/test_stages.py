"""The stages from end to end on synthetic projects whose truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from texproj.demo import write_demo
from texproj.formats.cameras import read_cameras
from texproj.options import ColorOptions, DemoOptions, RefineOptions
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.running import run_project

SMALL = DemoOptions(
    object="stele", photos=4, starts=True, paint=1, long_side=420, faces=8000, carved_faces=40_000
)


def with_options(project: Project, **sections) -> Project:
    settings = project.settings
    for name, options in sections.items():
        settings = settings.with_table(name, options)
    return project.with_settings(settings)


def colors_of(path) -> np.ndarray:
    return np.asarray(trimesh.load(path, process=False).visual.vertex_colors, float)[:, :3]


def errors_percent(project: Project) -> dict[str, float]:
    """Mean distance of the mesh's vertices from their true place, percent of the width."""
    truth = {
        r.file: r.camera for r in read_cameras(project.root / "truth" / "cameras.json").records
    }
    found = {n: r.registered_camera for n, r in project.load_cameras().items()}
    xyz = project.load_mesh().mesh.vertices
    out = {}
    for name, camera in found.items():
        if camera is not None:
            true = truth[name]
            xy = true.project(xyz)[0]
            seen = true.inside(xy)
            apart = np.linalg.norm(camera.project(xyz)[0] - xy, axis=1)[seen]
            out[name] = 100 * float(np.nanmean(apart)) / true.width
    return out


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Picks in half of the photos, rough cameras for the others, all around."""
    folder = tmp_path_factory.mktemp("stages") / "stele"
    write_demo(folder, replace(SMALL, photos=6, long_side=840, faces=60_000, carved_faces=80_000))
    project = Project.open(folder)
    with Workbench(project) as bench:
        outcome = run_project(bench)
    return project, outcome


def test_every_photo_that_is_called_registered_is_right(finished):
    """Whatever method found it: within 0.3 percent of the width; most of them far better."""
    project, outcome = finished
    errors = errors_percent(project)

    assert len(errors) >= 5
    assert max(errors.values()) < 0.3
    assert np.median(list(errors.values())) < 0.1
    assert all(name in outcome.failed for name in project.photo_names if name not in errors)


def test_the_report_names_every_photo_and_what_was_made(finished):
    """Numbers for machines, one page for people, no reference to other files."""
    project, outcome = finished
    facts = json.loads((project.out / "report.json").read_text())
    page = (project.out / "report.html").read_text()

    assert [p["file"] for p in facts["photos"]] == project.photo_names
    assert set(facts["color"]["files"]) == set(outcome.color.files)
    assert all(name in page for name in project.photo_names)
    rows = facts["color"]["quality"]["photos"]
    assert [row["file"] for row in rows] == list(outcome.color.used)
    for row in rows:
        assert "gain " + ", ".join(f"{gain:.2f}" for gain in row["gain"]) in page
        assert row["sharpness"] is None or f"has {100 * row['sharpness']:.0f} % of the" in page
    named = {name for lens in facts["color"]["quality"]["lenses"] for name in lens["photos"]}
    assert named <= set(project.photo_names)
    assert all(lens["photos"][0] + ", " in page for lens in facts["color"]["quality"]["lenses"])
    assert 'src="data:image/jpeg' in page and "http" not in page.split("<style>")[0]


def test_the_texture_shows_the_paint(finished):
    """Colors of the model against the true shaded colors: right where photos see the surface."""
    project, outcome = finished
    truth = colors_of(project.root / "truth" / "shaded.ply")
    vertices = with_options(project, color=ColorOptions(to="vertices"))
    from texproj.stages.coloring import color_project

    with Workbench(vertices) as bench:
        color_project(bench)
    made = colors_of(project.out / "model.ply")
    gain = (made * truth).sum(axis=0) / (truth**2).sum(axis=0)  # exposure is up to the photos
    close = np.abs(made - gain * truth).mean(axis=1)

    assert outcome.color.quality["seen"] > 0.85
    assert np.median(close) < 14
    assert gain.min() > 0.6 and gain.max() < 1.6
    assert np.corrcoef(made[:, 2], truth[:, 2])[0, 1] > 0.85


def without_rough_cameras(folder, **sections) -> Project:
    """The project with the photos alone that have picks: the quickest to register."""
    project = Project.open(folder)
    for path in project.photo_paths.values():
        if not project.correspondences_path(path.name).is_file():
            path.unlink()
    return with_options(Project.open(folder), color=ColorOptions(to="vertices"), **sections)


def test_survey_coordinates_change_nothing(tmp_path):
    """The same piece half a million metres away: same colors, cameras moved along."""
    made = {}
    for name, origin in (("here", (0.0, 0.0, 0.0)), ("there", (512_000.0, 4_100_000.0, 250.0))):
        write_demo(tmp_path / name, replace(SMALL, origin=origin))
        alone = RefineOptions(enabled=False)
        project = without_rough_cameras(tmp_path / name, refine=alone)
        with Workbench(project) as bench:
            outcome = run_project(bench)
        assert not outcome.failed
        made[name] = colors_of(project.out / "model.ply"), errors_percent(project)
    apart = np.abs(made["here"][0] - made["there"][0]).max(axis=1)

    assert np.quantile(apart, 0.99) <= 4
    assert made["there"][1] == pytest.approx(made["here"][1], abs=0.05)


def test_a_fault_in_refining_leaves_each_photo_its_own_registration(project_folder, monkeypatch):
    """The model is made all the same, and the run says what it could not do."""

    def fault(*_, **__):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr("texproj.stages.running.refine_project", fault)
    with Workbench(without_rough_cameras(project_folder)) as bench:
        outcome = run_project(bench)

    assert outcome.color is not None
    assert "not refined together: internal fault" in outcome.fault
    assert outcome.tally.fault == outcome.fault
