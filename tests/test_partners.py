"""Which photos show the same: kept from run to run, and first to be asked where others are."""

from types import SimpleNamespace

import numpy as np
import pytest

from texproj.errors import InputError
from texproj.project import Project
from texproj.register.block.graph import PhotoGraph
from texproj.solve.features import Features
from texproj.stages.methods import MOST_COMPARED
from texproj.stages.neighborhood import Neighborhood
from texproj.stages.partners import (
    Partner,
    companions,
    compare_looks,
    keep_graph,
    load_graph,
    partners,
)
from texproj.stages.progress import silent

NAMES = [f"{k:02d}.jpg" for k in range(12)]


@pytest.fixture
def project(tmp_path):
    """Photos of which only the content counts."""
    (tmp_path / "photos").mkdir()
    for name in NAMES:
        (tmp_path / "photos" / name).write_bytes(name.encode())
    return Project.open(tmp_path)


def keep(project, matches, names):
    keep_graph(project, PhotoGraph(matches, frozenset(names)))


def looking(project, groups):
    """A workbench whose photos of one group show some of the same 400 things; the last photo is
    damaged.
    """
    rng = np.random.default_rng(0)
    things = rng.random((len(groups), 400, 128))

    def features(name):
        if name == NAMES[-1]:
            raise InputError(f"{name} is damaged")
        group = next(k for k, names in enumerate(groups) if name in names)
        rows = things[group][rng.permutation(400)[:300]] + rng.normal(0, 0.02, (300, 128))
        return Features(np.zeros((300, 2)), rows.astype(np.float32))

    return SimpleNamespace(project=project, features=features)


def test_what_photos_share_lasts_as_long_as_they_are_the_same(project):
    """Another run reads it; a photo that was replaced has no partners any more, others keep
    theirs, and what is found later stands beside it.
    """
    a, b, c, d = NAMES[:4]
    keep(project, {(a, b): 40, (a, c): 90}, [a, b, c])
    assert partners(Project.open(project.root), a) == (Partner(c, 90), Partner(b, 40))

    (project.root / "photos" / c).write_bytes(b"another picture")
    again = Project.open(project.root)
    keep(again, {(b, d): 7, (a, b): 41}, [a, b, d])

    assert load_graph(again).matches == {(a, b): 41, (b, d): 7}
    assert partners(again, c) == ()


def test_a_mask_makes_a_photo_another_one(project):
    """Features are sought where the mask is not, so what was found without it is old."""
    a, b = NAMES[:2]
    keep(project, {(a, b): 40}, [a, b])
    (project.root / "masks").mkdir()
    (project.root / "masks" / "00.png").write_bytes(b"stencil")

    assert partners(Project.open(project.root), b) == ()


def test_photos_that_show_the_same_come_before_those_of_the_next_names():
    """What was matched decides, then the order of names; none is named twice, none that is not
    registered, none that is set apart.
    """
    near = Neighborhood(NAMES, set(NAMES[2:]), {"06.jpg": ("11.jpg", "00.jpg", "05.jpg", "02.jpg")})
    found = near.around("06.jpg", "02.jpg".__eq__)

    assert found[:4] == ("11.jpg", "05.jpg", "07.jpg", "04.jpg")
    assert len(set(found)) == len(found) == MOST_COMPARED
    near.remove("11.jpg")
    assert near.around("06.jpg", "02.jpg".__eq__)[0] == "05.jpg"
    near.add("11.jpg")
    assert near.around("06.jpg", "02.jpg".__eq__) == found


def test_photos_that_look_alike_are_found_whatever_their_names(project):
    """Two things photographed in turn: the companions of each photo are of its own thing first;
    a photo that cannot be read is nobody's, and stops nothing.
    """
    groups = (NAMES[0:11:2], NAMES[1:11:2])
    compare_looks(looking(project, groups), silent)
    found = companions(Project.open(project.root))

    assert set(found) == set(NAMES[:-1])
    for own in groups:
        for name in own:
            assert set(found[name][: len(own) - 1]) == {*own} - {name}


def test_what_was_matched_comes_before_what_looks_alike(project):
    """Likeness is a guess, verified matches are none."""
    compare_looks(looking(project, (NAMES[0:11:2], NAMES[1:11:2])), silent)
    keep(project, {("00.jpg", "01.jpg"): 30}, NAMES[:2])
    found = companions(project)

    assert found["00.jpg"][0] == "01.jpg"
    assert sorted(found["00.jpg"]) == NAMES[1:-1]
    told = partners(project, "00.jpg")
    assert told[0] == Partner("01.jpg", 30)
    assert {partner.name for partner in told[1:] if partner.matches is None} == set(NAMES[2:-1])


def test_a_photo_of_another_place_stands_apart():
    """It was compared and shares next to nothing with the photos that are registered, whatever it
    shares with photos of its own place; of a photo that was not compared nothing is concluded.
    """
    graph = PhotoGraph({("a", "b"): 300, ("b", "x"): 17, ("x", "y"): 500}, frozenset("abxy"))

    assert graph.stands_apart("x", {"a", "b"})
    assert not graph.stands_apart("x", {"a", "y"})
    assert not graph.stands_apart("a", {"a", "b"})
    assert not graph.stands_apart("z", {"a", "b"})


def test_a_few_matches_make_no_partners():
    """Photos of two places had up to 20 verified matches: chance."""
    graph = PhotoGraph({("a", "b"): 300, ("b", "x"): 20}, frozenset("abx"))

    assert graph.neighbors("b") == ("a",)
    assert graph.neighbors("x") == ()
    assert not graph.stands_apart("x", {"z"})
