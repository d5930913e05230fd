"""Import and export as stages and commands: what lands in cameras.json, and what is refused."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image, ImageOps

from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli import main
from texproj.errors import InputError, OutputError, UsageError
from texproj.formats.cameras import read_cameras
from texproj.formats.interchange import READERS, WRITERS, Shot, upright
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.entries import start_of
from texproj.stages.exchanging import import_cameras
from texproj.stages.exporting import export_cameras
from texproj.stages.lineage import registration_freshness

WIDTH, HEIGHT = 80, 60
NAMES = ("one.jpg", "Two.JPG", "three.png")
LENS = Intrinsics(WIDTH, HEIGHT, 90, 90, 40, 30)


def looking(k: int, lens: Intrinsics = LENS) -> Camera:
    """A camera around the unit box, looking at its middle."""
    angle = 0.7 * k
    center = (5 * np.cos(angle), 5 * np.sin(angle), 1.5)
    return Camera(lens, Pose.look_at(center, (0, 0, 0)))


def away(k: int) -> Camera:
    camera = looking(k)
    return Camera(LENS, Pose.look_at(camera.center, 2 * camera.center))


@pytest.fixture
def project(tmp_path) -> Project:
    """A box and three black photos."""
    root = tmp_path / "box"
    (root / "mesh").mkdir(parents=True)
    (root / "photos").mkdir()
    trimesh.creation.box().export(root / "mesh" / "box.ply")
    for name in NAMES:
        photo(root, name, (WIDTH, HEIGHT))
    return Project.open(root)


def photo(root, name, size, orientation=1):
    exif = Image.Exif()
    exif[274] = orientation
    Image.new("RGB", size).save(root / "photos" / name, exif=exif)


def file_of(tmp_path, cameras, kind="nerfstudio"):
    """A camera file with cameras by name."""
    folder = tmp_path / f"from-{kind}"
    folder.mkdir(exist_ok=True)
    shots = [Shot(name, f"images/{name}", camera) for name, camera in cameras.items()]
    for name, content in WRITERS[kind](shots, "mesh.ply").files.items():
        (folder / name).write_bytes(content)
    return folder


def take(project, path, **more):
    with Workbench(project) as bench:
        return import_cameras(bench, path, **more)


def register(project, **cameras):
    """Entries as somebody registered them here."""
    project.save_cameras(
        CameraRecord(f"{name}.jpg", WIDTH, HEIGHT, c.intrinsics, c.pose, "registered", "points",
                     extra={"start": None, "mine": 7})
        for name, c in cameras.items()
    )  # fmt: skip


# --- import


def test_cameras_are_taken_as_registered(project, tmp_path):
    """Pose and lens arrive to the last digits, vouched for, with the share of the mesh in view."""
    outcome = take(project, file_of(tmp_path, {"one.jpg": looking(0)}, "colmap"))
    entry = project.load_cameras()["one.jpg"]

    assert (entry.status, entry.method) == ("registered", "import")
    np.testing.assert_allclose(entry.pose.R, looking(0).pose.R, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(entry.pose.t, looking(0).pose.t)
    assert outcome.in_view == {"one.jpg": 1.0} and entry.quality["mesh_in_view"] == 1.0
    assert outcome.format == "colmap" and outcome.failed == {}
    assert set(outcome.missing) == {"Two.JPG", "three.png"}
    states = {state.item: state for state in registration_freshness(project)}
    assert states["one.jpg"].fresh and not states["three.png"].fresh


def test_as_prior_they_are_where_registration_starts(project, tmp_path):
    """Status "prior": not vouched for, but known to whoever registers the photo."""
    take(project, file_of(tmp_path, {"one.jpg": looking(0)}), status="prior")
    entry = project.load_cameras()["one.jpg"]

    assert entry.status == "prior" and entry.registered_camera is None
    assert start_of(entry).camera is not None


def test_only_photos_in_the_file_are_replaced(project, tmp_path):
    """The entry of a photo that the file does not name stays bit by bit; a replaced one loses
    what its registration had left there, but no key that somebody else put in.
    """
    register(project, one=looking(0), other=looking(2))
    before = project.load_cameras()
    take(project, file_of(tmp_path, {"one.jpg": looking(1)}))
    after = read_cameras(project.cameras_path).records
    one, other = (next(r for r in after if r.file == n) for n in ("one.jpg", "other.jpg"))

    np.testing.assert_allclose(one.pose.t, looking(1).pose.t, atol=1e-12)
    assert one.method == "import" and one.extra == {"mine": 7}
    np.testing.assert_array_equal(other.pose.t, before["other.jpg"].pose.t)
    assert other.extra == before["other.jpg"].extra and other.method == "points"


def test_cameras_of_another_project_are_taken(project, tmp_path):
    """cameras.json is a camera file too; what has no camera there is refused for its photo."""
    register(project, one=looking(0))
    project.save_cameras([CameraRecord("Two.JPG", WIDTH, HEIGHT, LENS, None, "failed")])
    elsewhere = project.cameras_path.rename(tmp_path / "old.json")
    outcome = take(project, elsewhere)

    assert outcome.format == "texproj" and list(outcome.in_view) == ["one.jpg"]
    assert outcome.failed == {"Two.JPG": "it has no camera there"}


@pytest.mark.parametrize(
    ("told", "photo_name"),
    [
        ("one.jpg", "one.jpg"),
        ("D:\\shots\\one.jpg", "one.jpg"),
        ("two.jpg", "Two.JPG"),
        ("undistorted/three.tif", "three.png"),
        ("three", "three.png"),
    ],
)
def test_photos_are_found_by_what_others_call_them(told, photo_name, project, tmp_path):
    """With folders, in other case, with another ending or none."""
    outcome = take(project, file_of(tmp_path, {told: looking(0)}))

    assert list(outcome.in_view) == [photo_name]


def test_the_exact_name_wins_and_equal_claims_fail(project, tmp_path):
    """one.jpg beats one.tif for one.jpg; a/three.png and b/three.png are told apart by nothing."""
    cameras = {"one.tif": looking(2), "one.jpg": looking(0), "a/three.png": looking(1),
               "b/three.png": looking(2)}  # fmt: skip
    outcome = take(project, file_of(tmp_path, cameras))

    got = project.load_cameras()["one.jpg"].pose.t
    np.testing.assert_allclose(got, looking(0).pose.t, atol=1e-12)
    assert (
        "2 cameras" in outcome.failed["three.png"] and "b/three.png" in outcome.failed["three.png"]
    )


def test_names_without_a_photo_are_told(project, tmp_path):
    """What the project does not have is named, and stops nothing."""
    outcome = take(project, file_of(tmp_path, {"one.jpg": looking(0), "IMG_9.jpg": looking(1)}))

    assert outcome.unmatched == ("images/IMG_9.jpg",) and outcome.failed == {}


def test_a_file_without_our_photos_writes_nothing(project, tmp_path):
    """One sentence with names of both sides."""
    with pytest.raises(InputError, match=r"IMG_9\.jpg.*Two\.JPG"):
        take(project, file_of(tmp_path, {"IMG_9.jpg": looking(1)}))

    assert not project.cameras_path.exists()


def test_another_size_of_the_same_shape_is_rescaled(project, tmp_path):
    """A camera for 800 x 600 sees the same points in the photo of 80 x 60, ten times closer."""
    large = looking(0, replace(LENS, dist=(0.1, 0, 0, 0, 0)).resized(800, 600))
    outcome = take(project, file_of(tmp_path, {"one.jpg": large}))
    camera = project.load_cameras()["one.jpg"].camera
    point = [[0.3, 0.2, 0.1]]

    assert (camera.width, camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(camera.project(point)[0], large.project(point)[0] / 10, atol=1e-9)
    assert "rescaled from 800 x 600 to 80 x 60" in outcome.notes["one.jpg"]


def test_another_shape_fails_for_its_photo_alone(project, tmp_path):
    """Both sizes are in the reason; the other photo has its camera."""
    wrong = Camera(Intrinsics(80, 50, 90, 90, 40, 25), looking(0).pose)
    outcome = take(project, file_of(tmp_path, {"one.jpg": wrong, "Two.JPG": looking(1)}))

    assert outcome.failed == {"one.jpg": "its camera is for 80 x 50 pixels, the photo has 80 x 60"}
    assert list(project.load_cameras()) == ["Two.JPG"]


def test_a_camera_that_sees_nothing_of_the_mesh_fails(project, tmp_path):
    """It is not written, and an entry that was there stays."""
    register(project, one=looking(0))
    outcome = take(project, file_of(tmp_path, {"one.jpg": away(0), "Two.JPG": looking(1)}))

    assert "does not look at the mesh" in outcome.failed["one.jpg"]
    np.testing.assert_array_equal(project.load_cameras()["one.jpg"].pose.t, looking(0).pose.t)


def test_cameras_of_another_convention_are_refused_together(project, tmp_path):
    """Poses with OpenGL's axes written as if they were OpenCV's look the other way: one sentence
    says so, and nothing is written.
    """
    flip = np.diag([1.0, -1.0, -1.0])
    wrong = {
        n: Camera(LENS, Pose(flip @ looking(k).pose.R, flip @ looking(k).pose.t))
        for k, n in enumerate(NAMES)
    }
    with pytest.raises(InputError, match="these cameras do not look at the mesh"):
        take(project, file_of(tmp_path, wrong, "colmap"))

    assert not project.cameras_path.exists()


def test_a_close_view_between_vertices_sees_the_mesh(project, tmp_path):
    """A picture that holds no vertex but the inside of a face is a view of the mesh."""
    tele = replace(LENS, fx=400.0, fy=400.0)
    close = Camera(tele, Pose.look_at((0.1, 0.2, 0.6), (0.1, 0.2, 0), (0, 1, 0)))
    outcome = take(project, file_of(tmp_path, {"one.jpg": close}))

    assert outcome.in_view == {"one.jpg": 0.0} and outcome.failed == {}
    assert "mesh's own frame" in outcome.remarks[-1]


def test_large_coordinates_are_told(tmp_path):
    """Geocentric cameras keep their digits, and a remark says how large they are."""
    root, far = tmp_path / "far", np.array([-5_041_986.5, 2_573_482.25, -2_929_105.0])
    (root / "mesh").mkdir(parents=True)
    (root / "photos").mkdir()
    box = trimesh.creation.box()
    np.savetxt(root / "mesh" / "box.obj", box.vertices + far, fmt="v %.6f %.6f %.6f")
    with (root / "mesh" / "box.obj").open("a") as file:
        np.savetxt(file, box.faces + 1, fmt="f %d %d %d")
    photo(root, "one.jpg", (WIDTH, HEIGHT))
    camera = Camera(LENS, Pose(looking(0).pose.R, looking(0).pose.t - looking(0).pose.R @ far))
    project = Project.open(root)
    outcome = take(project, file_of(tmp_path, {"one.jpg": camera}, "metashape"))

    assert outcome.in_view == {"one.jpg": 1.0} and "5.04e+06" in outcome.remarks[-1]
    got = project.load_cameras()["one.jpg"].camera.center
    np.testing.assert_allclose(got, camera.center, rtol=0, atol=1e-8)


# --- cameras that the picture contradicts


def truth_of(folder):
    """The project of the small demo without any camera, and its true cameras."""
    (folder / "cameras.json").unlink()
    records = read_cameras(folder / "truth" / "cameras.json").records
    return Project.open(folder), {record.file: record.camera for record in records}


def rolled(cameras):
    """All cameras upside down: of photos whose EXIF the other program ignored."""
    return {name: upright(camera, 3) for name, camera in cameras.items()}


def test_what_the_picture_proves_is_registered(project_folder, tmp_path):
    """The numbers that were looked at are in each entry's quality."""
    project, cameras = truth_of(project_folder)
    outcome = take(project, file_of(tmp_path, cameras))
    entries = project.load_cameras()

    assert set(outcome.status.values()) == {"registered"} and outcome.starts == {}
    assert all(entry.quality["standing"] == "proved" for entry in entries.values())
    assert all(entry.quality["patches_in_place"] > 0.3 for entry in entries.values())


def test_the_story_of_proved_cameras_can_be_told(project_folder, tmp_path, capsys):
    """What import tells of its proof is no obstacle to what registration tells of its own."""
    project, cameras = truth_of(project_folder)
    take(project, file_of(tmp_path, cameras))
    capsys.readouterr()

    assert main(["status", str(project_folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)


def test_what_the_picture_contradicts_is_a_start(project_folder, tmp_path, capsys):
    """Cameras that read well and see the mesh, but not as the photos do: nobody vouches for them,
    a sentence says why, and registration starts from there; exit 1.
    """
    project, cameras = truth_of(project_folder)
    folder = file_of(tmp_path, rolled(cameras))
    assert main(["import", str(project.root), str(folder), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    entries = project.load_cameras()

    assert set(told["status"].values()) == {"prior"} and set(told["starts"]) == set(cameras)
    assert all(entry.registered_camera is None and entry.camera for entry in entries.values())
    assert all(entries[name].quality["reason"] == why for name, why in told["starts"].items())

    main(["import", str(project.root), str(folder)])
    assert "registration starts from there" in capsys.readouterr().out


def test_a_registered_camera_stays_where_the_new_one_is_contradicted(project_folder, tmp_path):
    """Nothing that works is lost to a wrong file."""
    project, cameras = truth_of(project_folder)
    take(project, file_of(tmp_path, cameras))
    before = project.cameras_path.read_bytes()
    with pytest.raises(InputError, match="registered camera of this photo stays"):
        take(project, file_of(tmp_path, rolled(cameras)))

    assert project.cameras_path.read_bytes() == before


def test_as_prior_nothing_is_judged(project_folder, tmp_path):
    """Who asks for starts gets starts."""
    project, cameras = truth_of(project_folder)
    outcome = take(project, file_of(tmp_path, rolled(cameras)), status="prior")

    assert set(outcome.status.values()) == {"prior"} and outcome.starts == {}


def test_cameras_of_undistorted_pictures_are_no_cameras_of_the_photos(project, tmp_path):
    """Pictures made free of distortion differ little in size and have no distortion: nothing on a
    black photo proves that it is the same but for scale, so nobody vouches for the camera.
    """
    pinhole = looking(0, LENS.resized(88, 66))
    outcome = take(project, file_of(tmp_path, {"one.jpg": pinhole}, "colmap"))

    assert project.load_cameras()["one.jpg"].status == "prior"
    assert "88 x 66" in outcome.starts["one.jpg"] and "distortion" in outcome.starts["one.jpg"]


def test_what_the_reader_says_is_told_when_nothing_can_be_taken(project, tmp_path):
    """A georeferenced chunk whose cameras stand elsewhere: the error says what the chunk is."""
    folder = file_of(tmp_path, {"one.jpg": away(0)}, "metashape")
    path = folder / "cameras.xml"
    reference = "<reference>GEOGCS[]</reference></chunk>"
    path.write_text(path.read_text().replace("</chunk>", reference))

    with pytest.raises(InputError, match=r"do not look at the mesh.*georeferenced"):
        take(project, path)


def test_a_name_is_the_same_however_its_accents_are_written(project, tmp_path):
    """macOS writes letter and accent apart; others as one letter."""
    composed, apart = "caf\u00e9.jpg", "cafe\u0301.jpg"
    photo(project.root, apart, (WIDTH, HEIGHT))
    outcome = take(Project.open(project.root), file_of(tmp_path, {composed: looking(0)}))

    assert list(outcome.in_view) == [apart]


def test_models_that_were_not_read_are_told(project, tmp_path):
    """COLMAP's largest model is read; a remark names the others."""
    for part, names in (("0", NAMES[:1]), ("1", NAMES[1:])):
        folder = tmp_path / "ws" / "sparse" / part
        folder.mkdir(parents=True)
        shots = [Shot(name, name, looking(k)) for k, name in enumerate(names)]
        for name, content in WRITERS["colmap"](shots, "mesh.ply").files.items():
            (folder / name).write_bytes(content)
    outcome = take(project, tmp_path / "ws")

    assert set(outcome.in_view) == set(NAMES[1:])
    assert any("0 (1 photos)" in remark for remark in outcome.remarks)


# --- photos that EXIF turns


def lying(folder, orientation, names=None):
    """The demo's photos stored turned, with EXIF to make them upright again."""
    stored = {3: Image.ROTATE_180, 6: Image.ROTATE_90, 8: Image.ROTATE_270}[orientation]
    exif = Image.Exif()
    exif[274] = orientation
    for path in sorted((folder / "photos").iterdir()):
        if names is None or path.name in names:
            upright_pixels = ImageOps.exif_transpose(Image.open(path))
            upright_pixels.transpose(stored).save(path, quality=97, exif=exif)


@pytest.mark.parametrize("ignored", [False, True])
def test_the_picture_tells_how_upside_down_photos_were_meant(ignored, project_folder, tmp_path):
    """EXIF 3 changes no size: with nothing else to go by, both are tried on the picture, and the
    cameras come out right whether the other program turned the photos or not.
    """
    project, cameras = truth_of(project_folder)
    lying(project.root, 3)
    told = rolled(cameras) if ignored else cameras
    outcome = take(Project.open(project.root), file_of(tmp_path, told))
    entries = project.load_cameras()

    assert set(outcome.status.values()) == {"registered"}
    for name, camera in cameras.items():
        np.testing.assert_allclose(entries[name].pose.R, camera.pose.R, atol=1e-9)


@pytest.mark.parametrize("painted_on", ["upright", "stored"])
def test_a_mask_of_the_stored_picture_is_told(painted_on, project_folder, tmp_path):
    """The outline of the piece as it lies in an upside-down file fits the mesh only turned: the
    import says what to do; the outline of the upright picture is fine.
    """
    project, cameras = truth_of(project_folder)
    lying(project.root, 3)
    name = next(iter(cameras))
    k = cameras[name].intrinsics
    outline = np.zeros((k.height, k.width), np.uint8)
    points = cameras[name].project(project.load_mesh().mesh.vertices)[0]
    hull = cv2.convexHull(points[np.isfinite(points).all(axis=1)].astype(np.int32))
    cv2.fillConvexPoly(outline, hull, 255)
    turned = outline[::-1, ::-1] if painted_on == "stored" else outline
    (project.root / "masks").mkdir(exist_ok=True)
    path = project.root / "masks" / f"{name.partition('.')[0]}.png"
    cv2.imwrite(str(path), turned)
    outcome = take(Project.open(project.root), file_of(tmp_path, cameras))

    told = "mask" in outcome.notes.get(name, "")
    assert told == (painted_on == "stored")


def test_one_photo_tells_what_the_program_did_with_all(project, tmp_path):
    """A photo of orientation 6 has another shape lying than upright: what the program did with it
    decides for the upside-down ones, on black photos too.
    """
    photo(project.root, "one.jpg", (WIDTH, HEIGHT), orientation=6)
    photo(project.root, "Two.JPG", (WIDTH, HEIGHT), orientation=3)
    outcome = take(project, file_of(tmp_path, {"one.jpg": looking(0), "Two.JPG": looking(1)}))
    got = project.load_cameras()["Two.JPG"].camera.pose.R

    np.testing.assert_allclose(got, upright(looking(1), 3).pose.R, atol=1e-12)
    assert "stored picture" in outcome.notes["Two.JPG"]


def test_metashape_says_what_it_did(project, tmp_path):
    """Its <orientation> is EXIF's where the camera is of the stored picture."""
    photo(project.root, "one.jpg", (WIDTH, HEIGHT), orientation=3)
    folder = file_of(tmp_path, {"one.jpg": looking(0)}, "metashape")
    path = folder / "cameras.xml"
    orientation = "</transform><orientation>3</orientation>"
    path.write_text(path.read_text().replace("</transform>", orientation))
    take(project, path)

    got = project.load_cameras()["one.jpg"].camera.pose.R
    np.testing.assert_allclose(got, upright(looking(0), 3).pose.R, atol=1e-12)


def test_files_without_sizes_are_read_for_the_stored_picture_too(project_folder, tmp_path):
    """RealityScan's table tells no size; of photos that lie on their side the camera may be of the
    stored picture, whose size is the other way round.
    """
    project, cameras = truth_of(project_folder)
    plain = {
        n: Camera(replace(c.intrinsics, dist=(c.intrinsics.dist[0], 0, 0, 0, 0)), c.pose)
        for n, c in cameras.items()
    }
    lying(project.root, 6)
    stored = {name: upright(camera, 8) for name, camera in plain.items()}
    take(Project.open(project.root), file_of(tmp_path, stored, "realityscan"))
    entries = project.load_cameras()

    for name, camera in plain.items():
        got = entries[name]
        assert got.status == "registered" and got.width == camera.width
        np.testing.assert_allclose(got.pose.R, camera.pose.R, atol=1e-9)
        assert (got.intrinsics.cx, got.intrinsics.cy) == pytest.approx(
            (camera.intrinsics.cx, camera.intrinsics.cy)
        )


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_turning_a_camera_is_turning_its_picture(orientation):
    """A point's pixel in the turned camera is where OpenCV's rotation puts it in the picture."""
    prism = (0.01, 0.02, 0.03, -0.01)
    dist = (0.1, -0.05, 0.02, -0.03, 0.01, 0, 0, 0, *prism)
    lens = Intrinsics(80, 60, 90, 80, 38, 33, dist)
    stored = Camera(lens, looking(1).pose)
    turned = upright(stored, orientation)
    points = np.random.default_rng(3).uniform(-0.8, 0.8, (10, 3))
    (x, y), w, h = stored.project(points)[0].T, 80, 60
    expected = {3: (w - x, h - y), 6: (h - y, x), 8: (y, w - x)}[orientation]

    np.testing.assert_allclose(turned.project(points)[0].T, expected, atol=1e-9)
    code = {3: cv2.ROTATE_180, 6: cv2.ROTATE_90_CLOCKWISE, 8: cv2.ROTATE_90_COUNTERCLOCKWISE}
    picture = np.arange(h * w).reshape(h, w).astype(np.int32)
    col, row = 10, 7  # the pixel whose center is (10.5, 7.5)
    at = {3: (w - 10.5, h - 7.5), 6: (h - 7.5, 10.5), 8: (7.5, w - 10.5)}[orientation]
    assert cv2.rotate(picture, code[orientation])[int(at[1]), int(at[0])] == picture[row, col]


def test_a_mirrored_photo_has_no_camera():
    assert upright(looking(0), 5) is None


def test_a_camera_of_the_stored_picture_is_turned_upright(project, tmp_path):
    """Many programs ignore EXIF's orientation: their size tells."""
    photo(project.root, "one.jpg", (WIDTH, HEIGHT), orientation=6)
    outcome = take(project, file_of(tmp_path, {"one.jpg": looking(0)}))
    camera = project.load_cameras()["one.jpg"].camera
    (x, y) = looking(0).project([[0.3, 0.2, 0.1]])[0][0]

    assert (camera.width, camera.height) == (HEIGHT, WIDTH)
    assert camera.project([[0.3, 0.2, 0.1]])[0][0] == pytest.approx([HEIGHT - y, x])
    assert "turned upright" in outcome.notes["one.jpg"]


def test_export_tells_of_photos_that_exif_turns(project):
    """Who ignores EXIF would put our camera on the lying picture."""
    photo(project.root, "one.jpg", (HEIGHT, WIDTH), orientation=6)
    register(project, one=looking(0))

    assert "upright" in export_cameras(project, "colmap").notes["one.jpg"]


def test_a_table_without_a_lens_gives_a_start_with_the_focal_length_of_exif(project, tmp_path):
    """28 mm of a 43.3 mm film diagonal over 100 px; the camera is no more than a start."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    Image.new("RGB", (WIDTH, HEIGHT)).save(project.root / "photos" / "one.jpg", exif=exif)
    table = tmp_path / "poses.txt"
    table.write_text("name,x,y,z,omega,phi,kappa\none.jpg,0,0,5,0,0,0\n")
    outcome = take(project, table)
    entry = project.load_cameras()["one.jpg"]

    assert outcome.status == {"one.jpg": "prior"} and "no whole lens" in outcome.starts["one.jpg"]
    assert entry.intrinsics.fx == pytest.approx(28 / 43.27 * 100, rel=0.02)
    np.testing.assert_allclose(entry.camera.center, (0, 0, 5), atol=1e-12)


# --- export


@pytest.mark.parametrize("kind", sorted({*WRITERS} & {*READERS}))
def test_what_is_exported_can_be_imported(kind, project):
    """Each format, through its files in out/, gives back the cameras to 1e-9."""
    register(project, one=looking(0))
    outcome = export_cameras(project, kind)
    project.cameras_path.unlink()
    take(project, project.out / f"cameras-{kind}")
    got = project.load_cameras()["one.jpg"].camera

    assert outcome.photos == ("one.jpg",) and all(path.is_file() for path in outcome.files)
    np.testing.assert_allclose(got.pose.R, looking(0).pose.R, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.pose.t, looking(0).pose.t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.intrinsics.K, LENS.K, rtol=1e-12)


def test_photos_and_mesh_are_found_from_where_the_file_is(project, tmp_path):
    """Paths in the files lead from the folder that was asked for to the project's files."""
    register(project, one=looking(0))
    export_cameras(project, "meshlab", tmp_path / "elsewhere" / "deep")
    text = (tmp_path / "elsewhere" / "deep" / "cameras.mlp").read_text()

    assert 'fileName="../../box/photos/one.jpg"' in text
    assert 'filename="../../box/mesh/box.ply"' in text


def test_only_registered_cameras_are_exported(project):
    """A prior is nobody's camera yet; without any registered one nothing is written."""
    project.save_cameras(
        [CameraRecord("one.jpg", WIDTH, HEIGHT, LENS, looking(0).pose, "prior", None)]
    )
    with pytest.raises(InputError, match="no registered camera"):
        export_cameras(project, "colmap")
    assert not project.out.exists()


def test_a_place_that_cannot_be_written_is_said(project, tmp_path):
    register(project, one=looking(0))
    (tmp_path / "taken").write_text("a file")

    with pytest.raises(OutputError, match="taken"):
        export_cameras(project, "colmap", tmp_path / "taken")


def test_unknown_formats_name_the_nearest(project, tmp_path):
    with pytest.raises(UsageError, match="did you mean 'colmap'"):
        export_cameras(project, "colmpa")
    with pytest.raises(UsageError, match="did you mean 'meshroom'"):
        take(project, tmp_path, kind="meshrom")


# --- real photographs


@pytest.mark.parametrize("scene", ["fountain-P11", "sceaux-castle"])
@pytest.mark.parametrize("kind", ["colmap", "colmap-binary", "metashape", "meshlab", "nerfstudio"])
def test_real_cameras_go_through_every_exact_format(scene, kind, real_data, tmp_path):
    """Picked points of real photos fall on the same pixel to 1e-8 after export and reading."""
    folder = real_data(scene)
    records = read_cameras(folder / "cameras_reference.json").records
    shots = [Shot(r.file, r.file, r.camera) for r in records]
    result = WRITERS[kind](shots, "mesh.ply")
    for name, content in result.files.items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path if kind.startswith("colmap") else tmp_path / next(iter(result.files))
    model = READERS[kind](path, lambda name: None)
    found = {camera.name: camera.camera for camera in model.cameras}

    for record in records:
        picks = folder / "correspondences" / f"{record.file.split('.')[0]}.csv"
        points = np.loadtxt(picks, delimiter=",", skiprows=1, usecols=(2, 3, 4))
        told, ours = (c.project(points)[0] for c in (found[record.file], record.camera))
        np.testing.assert_allclose(told, ours, rtol=0, atol=1e-8)


# --- commands


def test_the_commands(project, tmp_path, capsys):
    """Export and import from the command line: 0 when all is done, JSON for machines."""
    register(project, one=looking(0))
    assert main(["export", str(project.root), "--format", "colmap", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    folder = project.out / "cameras-colmap"
    assert main(["import", str(project.root), str(folder), "--as", "prior", "--json"]) == 0
    taken = json.loads(capsys.readouterr().out)

    assert told["photos"] == ["one.jpg"] and str(folder / "images.txt") in told["files"]
    assert taken["in_view"] == {"one.jpg": 1.0} and taken["format"] == "colmap"
    assert project.load_cameras()["one.jpg"].status == "prior"


def test_a_failed_photo_is_exit_1_and_nothing_usable_exit_2(project, tmp_path, capsys):
    """Reasons are told on the way; unusable input is one sentence without a traceback."""
    some = file_of(tmp_path, {"one.jpg": away(0), "Two.JPG": looking(1)})
    assert main(["import", str(project.root), str(some)]) == 1
    told = capsys.readouterr()
    assert "one.jpg: FAILED: this camera does not look at the mesh" in told.out
    assert "Two.JPG: registered, 100 % of the mesh in the picture" in told.out
    assert "1 of 2 photos could not be given a camera" in told.err

    assert main(["import", str(project.root), str(tmp_path / "absent.xml")]) == 2
    told = capsys.readouterr()
    assert told.out == "" and "no camera file at" in told.err and "Traceback" not in told.err
