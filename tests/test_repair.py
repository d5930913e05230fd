"""The repair of meshes: what is dropped, what is counted, and the way back to the file."""

import time

import numpy as np
import pytest
import trimesh

from texproj.errors import InputError
from texproj.repair import first_equal_rows, repair

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def assert_consistent(source):
    """What the fields of a MeshSource promise of each other."""
    mapped = source.vertex_of_source[source.source_faces]
    np.testing.assert_array_equal(mapped, source.mesh.faces)
    has = source.vertex_of_source >= 0
    np.testing.assert_array_equal(
        source.mesh.vertices[source.vertex_of_source[has]], source.source_vertices[has]
    )
    assert set(np.unique(source.mesh.faces)) == set(range(len(source.mesh.vertices)))
    assert all(count > 0 for count in source.repairs.values())


def test_a_clean_mesh_comes_back_bit_for_bit():
    source = repair(SQUARE, SQUARE_FACES)
    np.testing.assert_array_equal(source.mesh.vertices, SQUARE)
    np.testing.assert_array_equal(source.mesh.faces, SQUARE_FACES)
    np.testing.assert_array_equal(source.vertex_of_source, np.arange(4))
    assert source.repairs == {}
    assert_consistent(source)


def test_unwelded_triangles_are_welded_at_their_first_vertex():
    source = repair(SQUARE[SQUARE_FACES].reshape(-1, 3), np.arange(6).reshape(2, 3))
    assert source.repairs == {"welded vertices": 2}
    np.testing.assert_array_equal(source.mesh.vertices, SQUARE)
    np.testing.assert_array_equal(source.vertex_of_source, [0, 1, 2, 0, 2, 3])
    assert_consistent(source)


def test_positions_that_differ_in_the_last_bit_are_not_welded():
    vertices = np.vstack([SQUARE, np.nextafter(SQUARE[:1], 1)])
    source = repair(vertices, [*SQUARE_FACES, [4, 1, 3]])
    assert len(source.mesh.vertices) == 5
    assert source.repairs == {}


def test_negative_zero_equals_zero():
    vertices = np.vstack([SQUARE, [[-0.0, -0.0, -0.0]]])
    source = repair(vertices, [[0, 1, 2], [4, 2, 3]])
    assert source.repairs == {"welded vertices": 1}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_vertices_go_with_their_faces_only(bad):
    vertices = np.vstack([SQUARE, [[0, bad, 0]], [[0, 0, 1]]])
    source = repair(vertices, [*SQUARE_FACES, [0, 1, 4], [0, 1, 5]])
    assert source.repairs == {"non-finite vertices": 1, "faces with non-finite vertices": 1}
    np.testing.assert_array_equal(source.vertex_of_source, [0, 1, 2, 3, -1, 4])
    np.testing.assert_array_equal(source.source_vertices, vertices)
    assert_consistent(source)


def test_faces_out_of_range_are_dropped():
    source = repair(SQUARE, [*SQUARE_FACES, [0, 1, 4], [-1, 1, 2], [0, 1, 2**31 - 1]])
    assert source.repairs == {"faces out of range": 3}
    np.testing.assert_array_equal(source.source_faces, SQUARE_FACES)


def test_degenerate_faces_are_repeated_indices_welded_corners_and_collinear_points():
    vertices = np.vstack([SQUARE, SQUARE[:1], [[0.5, 0.5, 0]]])
    faces = [*SQUARE_FACES, [1, 1, 2], [0, 4, 2], [0, 5, 2]]
    source = repair(vertices, faces)
    assert source.repairs["degenerate faces"] == 3
    assert_consistent(source)


def test_collinear_points_off_the_grid_are_degenerate_and_slivers_are_not():
    """Points on a line have rounding for a height; one millionth of the base is a real height."""
    line = np.array([0.1, 0.2, 0.3]) + np.outer([0, 1 / 3, 0.7], [0.3, 0.7, 0.9])
    sliver = [[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0]]
    vertices = np.vstack([SQUARE, line, sliver])
    source = repair(vertices, [*SQUARE_FACES, [4, 5, 6], [7, 8, 9]])
    assert source.repairs["degenerate faces"] == 1
    assert len(source.mesh.faces) == 3


def test_coordinates_beyond_all_measure_are_no_triangle():
    vertices = np.vstack([SQUARE, [[0, 0, 1e200]], [[0, 1e300, 0]]])
    source = repair(vertices, [*SQUARE_FACES, [0, 1, 4], [0, 4, 5]])
    assert source.repairs == {"degenerate faces": 2, "unreferenced vertices": 2}


@pytest.mark.parametrize("again", [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]])
def test_a_duplicate_face_is_dropped_whichever_way_it_turns_and_the_first_stays(again):
    source = repair(SQUARE, [*SQUARE_FACES, again])
    assert source.repairs == {"duplicate faces": 1}
    np.testing.assert_array_equal(source.mesh.faces, SQUARE_FACES)


def test_unreferenced_vertices_are_dropped_and_have_no_repaired_vertex():
    source = repair(np.vstack([[[9, 9, 9]], SQUARE]), SQUARE_FACES + 1)
    assert source.repairs == {"unreferenced vertices": 1}
    np.testing.assert_array_equal(source.vertex_of_source, [-1, 0, 1, 2, 3])
    assert_consistent(source)


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        (SQUARE, np.zeros((0, 3), int), "no faces"),
        (SQUARE, [[0, 1, 9]], "1 faces out of range"),
        (SQUARE * np.nan, SQUARE_FACES, "2 faces with non-finite vertices"),
        (SQUARE * 0, SQUARE_FACES, "2 degenerate faces"),
        (np.zeros((0, 3)), [[0, 1, 2]], "1 faces out of range"),
    ],
)
def test_a_mesh_without_a_usable_face_is_refused_with_the_reason(vertices, faces, says):
    with pytest.raises(InputError, match=says):
        repair(vertices, faces)


def test_surveyed_coordinates_lose_nothing():
    """At 5 000 000 m with 0.1 mm detail, shape and values stay those of the file."""
    offset = np.array([691_607.25, 5_334_760.5, 512.0])
    vertices = SQUARE * 1e-4 + offset
    source = repair(vertices, SQUARE_FACES)
    np.testing.assert_array_equal(source.mesh.vertices, vertices)
    assert source.repairs == {}


def test_all_faults_at_once_on_a_random_soup_keep_the_promises():
    rng = np.random.default_rng(7)
    vertices = rng.integers(0, 6, (400, 3)).astype(float)
    vertices[rng.integers(0, 400, 20)] = np.nan
    faces = rng.integers(-5, 405, (3000, 3))
    source = repair(vertices, faces)
    assert_consistent(source)
    assert len(np.unique(source.mesh.vertices, axis=0)) == len(source.mesh.vertices)
    corners = np.sort(source.mesh.faces, axis=1)
    assert len(np.unique(corners, axis=0)) == len(corners)
    again = repair(source.mesh.vertices, source.mesh.faces)
    assert again.repairs == {}


def test_first_equal_rows_agrees_with_a_dictionary():
    rows = np.random.default_rng(3).integers(0, 4, (500, 3))
    first: dict = {}
    expected = [first.setdefault(tuple(row), i) for i, row in enumerate(rows)]
    np.testing.assert_array_equal(first_equal_rows(rows), expected)


def test_a_million_faces_take_about_a_second():
    """Processor time; the bound is generous for busy machines."""
    n = 708
    y, x = np.mgrid[:n, :n]
    vertices = np.stack([x, y, np.sin(x / 9.0) * np.cos(y / 7.0)], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + n], axis=1),
            np.stack([corner + 1, corner + n + 1, corner + n], axis=1),
        ]
    )
    start = time.process_time()
    source = repair(vertices, faces)
    assert time.process_time() - start < 4
    assert source.repairs == {}
    assert len(source.mesh.faces) == len(faces)


@pytest.mark.parametrize(("origin", "told"), [(0.0, False), (1e3, False), (5e5, True), (5e6, True)])
def test_single_precision_that_is_too_coarse_is_told(origin, told):
    """A sphere of edges of 0.08 at UTM coordinates; in double precision nothing is lost."""
    sphere = trimesh.creation.icosphere(4)
    xyz = sphere.vertices + np.array([origin, origin, 0])
    notes = repair(xyz.astype(np.float32), sphere.faces).notes
    assert any("single precision rounds" in note for note in notes) == told
    assert repair(xyz, sphere.faces).notes == ()
