"""Images of the mesh: geometry known on paper, and the two renderers against each other."""

from concurrent.futures import ThreadPoolExecutor

import moderngl
import numpy as np
import pytest
import trimesh

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import RenderError
from texproj.mesh import Mesh
from texproj.options import RenderOptions
from texproj.render import CHANNELS, GBuffer, ideal_grid, open_renderer, pinhole_cover
from texproj.render.gl import GLRenderer

LENSES = {
    "none": (),
    "barrel": (-0.25, 0.08, 0.002, -0.001, 0.01),
    "pincushion": (0.2, 0.0, 0.0, 0.0, 0.0),
    "rational": (0.1, -0.05, 0.001, 0.002, 0.01, 0.3, -0.02, 0.01),
    "tilted": (-0.1, 0, 0, 0, 0, 0, 0, 0, 0.002, -0.001, 0.003, 0.001, 0.03, -0.02),
}
UTM = np.array([512_345.678, 5_412_345.678, 321.5])


@pytest.fixture(scope="module", params=["gl", "cpu"])
def renderer(request):
    with open_renderer(RenderOptions(renderer=request.param)) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def both():
    with open_renderer(RenderOptions("gl")) as gl, open_renderer(RenderOptions("cpu")) as cpu:
        yield gl, cpu


@pytest.fixture(autouse=True)
def _no_gl_error(request):
    """Nothing may leave an error on an OpenGL context."""
    yield
    for name in {"renderer", "both"} & set(request.fixturenames):
        value = request.getfixturevalue(name)
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, GLRenderer):
                with one.current():
                    assert one.ctx.error == "GL_NO_ERROR"


def camera(dist=(), size=(64, 48), focal=60.0, pose=None) -> Camera:
    """A small camera with an off-center principal point."""
    w, h = size
    k = Intrinsics(w, h, focal, focal * 1.02, w / 2 + 3.3, h / 2 - 2.7, dist)
    return Camera(k, pose or Pose.identity())


def quad(corners) -> Mesh:
    """A quad whose outside faces a camera at the origin if the corners run clockwise there."""
    return Mesh(np.array(corners, float), np.array([[0, 1, 2], [0, 2, 3]]))


TILTED = quad(np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ [[0.6, 0.05, 0.4], [0.03, 0.42, 0.1]]
              + [0.02, 0.03, 2.7])  # fmt: skip


def centers(cam: Camera) -> np.ndarray:
    """(h * w, 2) pixel centers, row by row."""
    x, y = np.meshgrid(np.arange(cam.width) + 0.5, np.arange(cam.height) + 0.5)
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def plane_of(mesh: Mesh) -> tuple[np.ndarray, float]:
    """Unit normal n and offset d of a flat mesh: n x = d."""
    a, b, c = mesh.vertices[mesh.faces[0]]
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n)
    return n, n @ a


def margin_px(mesh: Mesh, cam: Camera) -> np.ndarray:
    """(h, w) signed distance of each pixel's exact ray from the quad's outline, about in pixels;
    positive inside. Exact rays, exact plane: no renderer involved.
    """
    origins, directions = cam.rays(centers(cam))
    n, d = plane_of(mesh)
    points = origins + directions * ((d - origins @ n) / (directions @ n))[:, None]
    ring = mesh.vertices[[0, 1, 2, 3]]
    inward = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        side = np.cross(n, b - a)
        inward.append((points - a) @ (side / np.linalg.norm(side)))
    depth = cam.pose.apply(points)[:, 2]
    return (np.min(inward, axis=0) * cam.intrinsics.fx / depth).reshape(cam.height, cam.width)


@pytest.mark.parametrize("lens", LENSES)
def test_tilted_quad_covers_the_pixels_whose_rays_meet_it(renderer, lens):
    """Every pixel center more than 0.12 px inside of the outline is drawn, none that far outside.

    0.12 px: 0.1 px that split edges may stray, plus the slope of the plane.
    """
    cam = camera(LENSES[lens])
    with renderer.load(TILTED) as scene:
        drawn = scene.gbuffer(cam, ("face",)).face >= 0
    margin = margin_px(TILTED, cam)
    assert 400 < drawn.sum() < 2500
    assert drawn[margin > 0.12].all()
    assert not drawn[margin < -0.12].any()


@pytest.mark.parametrize("lens", LENSES)
def test_depth_is_metric_on_the_exact_ray(renderer, lens):
    """A pixel center unprojected to its depth lies on the quad's plane, to float32 or the sag."""
    cam = camera(LENSES[lens])
    with renderer.load(TILTED) as scene:
        images = scene.gbuffer(cam, ("depth",))
    depth = images.require("depth")
    seen = np.isfinite(depth)
    points = images.points(cam, *np.nonzero(seen))
    np.testing.assert_allclose(cam.project(points)[0], centers(cam)[seen.ravel()], atol=1e-6)
    n, d = plane_of(TILTED)
    tolerance = 2e-6 if lens == "none" or "cpu" in renderer.name.lower() else 2.5e-4
    assert np.abs(points @ n - d).max() < tolerance * 2.7
    assert np.isposinf(depth[~seen]).all()


@pytest.mark.parametrize("shift", [0.0, 0.24, 0.26, 0.49, 0.51, 0.76])
def test_edges_fall_between_pixel_centers(renderer, shift):
    """The left edge at u = 10.25 + shift: column 10 (center 10.5) is drawn until it passes."""
    u, z = 10.25 + shift, 5.0
    left = (u - 32) / 50 * z
    mesh = quad([(left, -1, z), (9, -1, z), (9, 9, z), (left, 9, z)])
    cam = Camera(Intrinsics(64, 48, 50, 50, 32, 24), Pose.identity())
    with renderer.load(mesh) as scene:
        row = scene.gbuffer(cam, ("face",)).face[40] >= 0
    assert np.flatnonzero(row)[0] == (10 if u < 10.5 else 11)


def test_rows_run_downwards(renderer):
    """The quad's top edge, y = -1 at z = 5, f = 50, cy = 24, is v = 14: row 14 is its first."""
    mesh = quad([(-1, -1, 5), (1, -1, 5), (1, 2, 5), (-1, 2, 5)])
    cam = Camera(Intrinsics(64, 48, 50, 50, 32, 24), Pose.identity())
    with renderer.load(mesh) as scene:
        rows = np.flatnonzero((scene.gbuffer(cam, ("face",)).face >= 0).any(axis=1))
    assert (rows[0], rows[-1]) == (14, 43)


def test_a_channel_that_was_not_rendered_is_named_when_it_is_required():
    image = np.ones((2, 3), np.float32)
    assert GBuffer(depth=image).require("depth") is image
    with pytest.raises(ValueError, match="no channel 'face', only depth"):
        GBuffer(depth=image).require("face")
    with pytest.raises(ValueError, match="no channel 'depth', only ao"):
        GBuffer(ao=image).points(camera(), np.array([0]), np.array([0]))


def test_channels_of_a_known_quad(renderer):
    """Normals, occlusion, sides and faces are the vertices' own, interpolated linearly."""
    mesh = quad([(-1, -1, 4), (1, -1, 4), (1, 1, 4), (-1, 1, 4)])
    ao = np.array([0, 1, 1, 0], np.float32)
    cam = Camera(Intrinsics(64, 48, 64, 64, 32, 24), Pose.identity())
    with renderer.load(mesh, ao) as scene:
        g = scene.gbuffer(cam, CHANNELS)
    inside = g.face >= 0
    u = np.broadcast_to((np.arange(64) + 0.5 - 16) / 32, (48, 64))
    np.testing.assert_allclose(g.ao[inside], u[inside], atol=1e-5)
    np.testing.assert_allclose(g.normal_in_cam[inside], np.tile([0, 0, 1.0], (inside.sum(), 1)))
    assert set(np.unique(g.face)) == {-1, 0, 1}
    assert g.face[10, 45] == 0
    assert g.face[38, 18] == 1
    assert not g.front.any()
    assert (g.normal_in_cam[~inside] == 0).all()
    assert (g.ao[~inside] == 0).all()


def test_both_sides_hide_and_only_the_outside_is_front(renderer):
    """A back side nearer than a front side hides it; `front` tells them apart."""
    near = [(-1, -1, 2), (0, -1, 2), (0, 1, 2), (-1, 1, 2)]
    far = [(-1, -1, 3), (-1, 1, 3), (1, 1, 3), (1, -1, 3)]
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    cam = Camera(Intrinsics(40, 40, 40, 40, 20, 20), Pose.identity())
    with renderer.load(Mesh(np.array(near + far, float), faces)) as scene:
        g = scene.gbuffer(cam, ("depth", "front"))
    assert g.depth[20, 10] == pytest.approx(2, rel=1e-6)
    assert not g.front[20, 10]
    assert g.depth[20, 25] == pytest.approx(3, rel=1e-6)
    assert g.front[20, 25]


def test_only_what_is_asked_is_made(renderer):
    """Other channels are None; unknown ones and occlusion that was never given are refused."""
    with renderer.load(TILTED) as scene:
        g = scene.gbuffer(camera(), ["normal", "normal"])
        assert list(g.channels()) == ["normal"]
        with pytest.raises(ValueError, match="did you mean 'depth'"):
            scene.gbuffer(camera(), ("depths",))
        with pytest.raises(ValueError, match="no channel"):
            scene.gbuffer(camera(), ())
        with pytest.raises(ValueError, match="without ambient occlusion"):
            scene.gbuffer(camera(), ("ao",))


def test_a_mesh_without_faces_or_with_wrong_occlusion_is_refused(renderer):
    """Both would draw nothing or garbage."""
    with pytest.raises(ValueError, match="without faces"):
        renderer.load(Mesh(np.zeros((3, 3)), np.zeros((0, 3), int)))
    with pytest.raises(ValueError, match="one value per vertex"):
        renderer.load(TILTED, np.zeros(3, np.float32))


def bumpy() -> Mesh:
    """A lumpy ball of radius about 1 with a handle's worth of self-occlusion, 20 k faces."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    v = np.asarray(ball.vertices)
    radius = 1 + 0.15 * np.sin(5 * v[:, 0]) * np.cos(4 * v[:, 1] + 1) + 0.1 * np.sin(7 * v[:, 2])
    return Mesh(v * radius[:, None], ball.faces)


@pytest.mark.parametrize("offset", [np.zeros(3), UTM], ids=["origin", "UTM"])
@pytest.mark.parametrize("lens", LENSES)
def test_the_twins_agree(both, lens, offset):
    """Same faces but for rounding at edges; depth, normals and occlusion tight inside; flips only
    within one pixel of a depth step, and few.
    """
    mesh = bumpy()
    mesh = Mesh(mesh.vertices + offset, mesh.faces)
    ao = (0.5 + 0.5 * np.sin(np.arange(len(mesh.vertices)))).astype(np.float32)
    center = offset + np.array([2.2, -1.5, 1.1])
    cam = camera(LENSES[lens], (160, 120), 150, Pose.look_at(center, offset))
    g, c = (_images(r, mesh, ao, cam) for r in both)
    step = _depth_steps(c.depth)
    inside = ~step & (c.face >= 0) & (g.face >= 0)

    assert inside.sum() > 4000
    assert ((g.face >= 0) == (c.face >= 0))[~step].all()
    assert np.mean((g.face >= 0) != (c.face >= 0)) < 1e-3
    assert np.mean(g.face[inside] != c.face[inside]) < 5e-3
    assert np.mean(g.front[inside] != c.front[inside]) < 1e-3
    np.testing.assert_allclose(g.depth[inside], c.depth[inside], rtol=2e-4)
    np.testing.assert_allclose(g.normal_in_cam[inside], c.normal_in_cam[inside], atol=0.01)
    np.testing.assert_allclose(g.ao[inside], c.ao[inside], atol=0.05)


def _images(renderer, mesh, ao, cam):
    with renderer.load(mesh, ao) as scene:
        return scene.gbuffer(cam, CHANNELS)


def _depth_steps(depth: np.ndarray) -> np.ndarray:
    """Pixels beside which depth jumps by more than 2 % or begins."""
    padded = np.pad(depth, 1, mode="edge")
    around = [padded[1 + j : padded.shape[0] - 1 + j, 1 + i : padded.shape[1] - 1 + i]
              for j in (-1, 0, 1) for i in (-1, 0, 1)]  # fmt: skip
    low, high = np.min(around, axis=0), np.max(around, axis=0)
    return ~(high < 1.02 * low)


@pytest.mark.parametrize("lens", ["none", "barrel"])
def test_large_coordinates_lose_nothing(renderer, lens):
    """Depth of a mesh at UTM coordinates equals that of the same mesh at the origin."""
    mesh, pose = bumpy(), Pose.look_at((2.2, -1.5, 1.1), (0, 0, 0))
    moved = Pose(pose.R, pose.t - pose.R @ UTM)
    images = []
    for where, at in ((0.0, pose), (UTM, moved)):
        with renderer.load(Mesh(mesh.vertices + where, mesh.faces)) as scene:
            images.append(scene.gbuffer(camera(LENSES[lens], pose=at), ("depth",)).depth)
    same = np.isfinite(images[0]) & np.isfinite(images[1])
    assert same.sum() > 500
    assert (np.isfinite(images[0]) != np.isfinite(images[1])).sum() <= 2
    assert np.percentile(np.abs(images[0][same] - images[1][same]), 99) < 1e-5


def test_tiles_make_the_same_picture():
    """A picture in 5 x 4 tiles is the whole one, bit for bit but for rounding at edges."""
    mesh = bumpy()
    cam = camera(LENSES["barrel"], (95, 70), 80, Pose.look_at((2.2, -1.5, 1.1), (0, 0, 0)))
    images = []
    for limit in (4096, 20):
        ctx = moderngl.create_context(standalone=True, backend="egl")
        with GLRenderer(ctx, tile_px=limit) as one, one.load(mesh) as scene:
            images.append(scene.gbuffer(cam, ("depth", "face", "normal")))
    whole, tiled = images
    same = whole.face == tiled.face
    assert same.mean() > 0.998
    np.testing.assert_allclose(whole.depth[same], tiled.depth[same], rtol=1e-4)
    np.testing.assert_allclose(whole.normal_in_cam[same], tiled.normal_in_cam[same], atol=5e-3)


def test_two_renderers_live_side_by_side(both):
    """Each draws its own mesh, whichever was opened or closed last."""
    gl, _ = both
    with gl.load(TILTED) as scene:
        before = scene.gbuffer(camera(), ("depth",)).depth
        with open_renderer(RenderOptions("gl")) as other, other.load(bumpy()) as second:
            ball = second.gbuffer(camera(), ("depth",)).depth
            between = scene.gbuffer(camera(), ("depth",)).depth
            again = second.gbuffer(camera(), ("depth",)).depth
        after = scene.gbuffer(camera(), ("depth",)).depth
    assert np.array_equal(before, between)
    assert np.array_equal(before, after)
    assert np.array_equal(ball, again)
    assert not np.array_equal(ball, before)


def test_threads_take_turns(both):
    """Four threads at once get what one gets alone."""
    cameras = [camera(size=(64 + i, 48)) for i in range(4)] * 5
    with both[0].load(TILTED) as scene, ThreadPoolExecutor(4) as pool:
        together = pool.map(lambda cam: scene.gbuffer(cam, ("depth",)).depth, cameras)
        for cam, depth in zip(cameras, together, strict=True):
            assert np.array_equal(depth, scene.gbuffer(cam, ("depth",)).depth)


def test_a_pass_leaves_nothing_behind():
    """What is drawn after it by plain OpenGL looks as if the pass had never been."""
    gl = open_renderer(RenderOptions("gl"))
    with gl, gl.load(TILTED) as scene, gl.current():
        before = _plain_triangle(gl.ctx)
        scene.gbuffer(camera(), CHANNELS[:3])
        scene.gbuffer(camera(LENSES["barrel"]), ("front",))
        assert _plain_triangle(gl.ctx) == before


def _plain_triangle(ctx) -> bytes:
    """Two overlapping triangles at depths 0.5 and 0.9, the farther last, without any state set."""
    program = ctx.program(
        vertex_shader="#version 330\nin vec3 p; void main() { gl_Position = vec4(p, 1.0); }",
        fragment_shader="#version 330\nout vec4 c; void main() { c = vec4(gl_FragCoord.z, "
        "gl_FrontFacing ? 1.0 : 0.0, 0.0, 1.0); }",
    )
    corners = [(-1, -1, 0.5), (3, -1, 0.5), (-1, 3, 0.5), (-1, -1, 0.9), (3, -1, 0.9), (-1, 3, 0.9)]
    buffer = ctx.buffer(np.array(corners, np.float32))
    vao = ctx.vertex_array(program, [(buffer, "3f", "p")])
    parts = [ctx.texture((8, 8), 4), ctx.depth_renderbuffer((8, 8))]
    target = ctx.framebuffer(parts[:1], parts[1])
    target.use()
    target.clear()
    vao.render()
    pixels = target.read(components=4)
    ctx.detect_framebuffer(0).use()
    for part in (target, *parts, vao, buffer, program):
        part.release()
    return pixels


def test_closing_gives_everything_back():
    """No object of the context outlives the scene."""
    with open_renderer(RenderOptions("gl")) as renderer:
        made, released = _count_objects(renderer.ctx)
        with renderer.load(TILTED, np.ones(4, np.float32)) as scene:
            scene.gbuffer(camera(), CHANNELS)
            scene.gbuffer(camera(LENSES["barrel"], (80, 60)), ("depth",))
            scene.gbuffer(camera(LENSES["barrel"], (640, 480), 600), ("depth",))
        assert len(made) > 15
        assert [m for m in made if m not in released] == []


def test_closing_twice_or_in_another_order_does_no_harm():
    """And what is closed says so."""
    renderer = open_renderer(RenderOptions("gl"))
    first, second = renderer.load(TILTED), renderer.load(TILTED)
    first.close()
    with pytest.raises(RenderError, match="scene is closed"):
        first.gbuffer(camera(), ("depth",))
    first.close()
    renderer.close()
    second.close()
    renderer.close()
    with pytest.raises(RenderError, match="renderer is closed"):
        second.gbuffer(camera(), ("depth",))


def _count_objects(ctx) -> tuple[list, set]:
    """Every object that `ctx` makes from now on, and the ids of those that are released."""
    made, released = [], set()

    def watched(make):
        def maker(*args, **kwargs):
            one = make(*args, **kwargs)
            made.append((type(one).__name__, one.glo))
            release = one.release
            one.release = lambda: (released.add((type(one).__name__, one.glo)), release())
            return one

        return maker

    kinds = "buffer texture depth_renderbuffer framebuffer program vertex_array"
    for name in kinds.split():
        setattr(ctx, name, watched(getattr(ctx, name)))
    return made, released


def test_camera_inside_the_mesh(both):
    """From inside of a ball every pixel sees it, whatever lies behind the camera."""
    cam = camera(LENSES["barrel"], pose=Pose.look_at((0.1, 0.2, 0.0), (1, 0, 0)))
    for renderer in both:
        with renderer.load(bumpy()) as scene:
            g = scene.gbuffer(cam, ("depth", "front"))
        assert np.isfinite(g.depth).all()
        assert not g.front.any()
        assert 0.4 < g.depth.min() < g.depth.max() < 1.5


def test_a_floor_that_passes_under_the_camera_has_no_cracks(renderer):
    """Two huge triangles, split for the lens, still cover every ray that meets the floor."""
    floor = quad([(-50, 1, -50), (50, 1, -50), (50, 1, 50), (-50, 1, 50)])
    cam = camera(LENSES["barrel"])
    with renderer.load(floor) as scene:
        depth = scene.gbuffer(cam, ("depth",)).depth
    _, rays = cam.rays(centers(cam))
    reaches = ((rays[:, 2] / rays[:, 1] < 50) & (rays[:, 1] > 0.02)).reshape(depth.shape)
    above = (rays[:, 1] < 0).reshape(depth.shape)
    assert np.isfinite(depth[reaches]).all()
    assert not np.isfinite(depth[above]).any()
    expected = (rays[:, 2] / rays[:, 1]).reshape(depth.shape)
    near = reaches & (expected < 10)
    np.testing.assert_allclose(depth[near], expected[near], rtol=0.02)


def test_pixels_outside_of_the_lens_model_are_empty(renderer):
    """k1 = -0.8 folds back at radius 0.645, distorted 0.43: corners of the photo have no ray."""
    cam = Camera(Intrinsics(64, 64, 60, 60, 32, 32, (-0.8, 0, 0, 0, 0)), Pose.identity())
    wall = quad([(-9, -9, 3), (9, -9, 3), (9, 9, 3), (-9, 9, 3)])
    with renderer.load(wall) as scene:
        g = scene.gbuffer(cam, ("depth", "face"))
    radius = np.linalg.norm(centers(cam) - 32, axis=1).reshape(64, 64) / 60
    assert np.isfinite(g.depth[radius < 0.41]).all()
    assert np.isposinf(g.depth[radius > 0.44]).all()
    assert (g.face[radius > 0.44] == -1).all()


def test_a_mesh_behind_the_camera_is_not_seen(renderer):
    """Neither mirrored nor by accident."""
    with renderer.load(TILTED) as scene:
        pose = Pose(np.diag([-1.0, 1, -1]), np.zeros(3))
        assert (scene.gbuffer(camera(pose=pose), ("face",)).face == -1).all()


@pytest.mark.parametrize("lens", [k for k in LENSES if k != "none"])
def test_ideal_grid_is_the_undistorted_pixel_grid(lens):
    """To 0.01 px, by distorting it again."""
    k = camera(LENSES[lens], (160, 120), 150).intrinsics
    back = k.distort(ideal_grid(k).reshape(-1, 2)) * (k.fx, k.fy) + (k.cx, k.cy)
    assert np.abs(back - centers(Camera(k, Pose.identity()))).max() < 0.011


@pytest.mark.parametrize("lens", LENSES)
def test_pinhole_cover_holds_every_ray(lens):
    """Every photo pixel's ray falls into the cover, which is nowhere coarser than the photo, and
    wastes little.
    """
    cam = camera(LENSES[lens], (160, 120), 150)
    cover = pinhole_cover(cam)
    _, rays = cam.rays(np.concatenate([centers(cam), [(0, 0), (160, 0), (160, 120), (0, 120)]]))
    xy, _ = cover.project(cover.center + rays)
    assert not cover.intrinsics.distorted
    assert ((xy >= 0) & (xy <= (cover.width, cover.height))).all()
    assert cover.width * cover.height < 2.5 * 160 * 120
    grid = xy[: 160 * 120].reshape(120, 160, 2)
    apart = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    assert apart.min() > 0.995


def test_cover_of_an_undistorted_photo_is_its_camera():
    """No resampling without need."""
    cam = camera()
    assert pinhole_cover(cam) is cam


def test_without_opengl_the_processor_takes_over(monkeypatch):
    """`auto` falls back and says why; `gl` fails with the line that installs what is missing."""

    def missing(**_):
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(moderngl, "create_context", missing)
    with open_renderer() as renderer:
        assert renderer.name.startswith("CPU")
        assert renderer.fallback_reason == "libEGL.so not loaded"
    with pytest.raises(RenderError, match=r"libEGL\.so not loaded.*apt-get install .*libegl1"):
        open_renderer(RenderOptions(renderer="gl"))


def test_real_vertices_project_where_they_are_drawn(real_data, renderer):
    """Depth at a vertex's pixel is the vertex's own depth, for the visible ones: the median of the
    signed difference is far below the depth that one pixel spans.
    """
    import json

    folder = real_data("fountain-P11")
    loaded = trimesh.load(folder / "mesh.ply", process=False)
    mesh = Mesh(loaded.vertices, loaded.faces)
    p = json.loads((folder / "cameras_reference.json").read_text())["photos"][4]
    k = Intrinsics.from_K(p["K"], p["width"], p["height"], (-0.1, 0.02, 0.001, 0, 0))
    cam = Camera(k, Pose(p["R"], p["t"])).resized(768, 512)
    with renderer.load(mesh) as scene:
        image = scene.gbuffer(cam, ("depth",)).depth
    xy, depth = cam.project(mesh.vertices)
    inside = cam.inside(xy)
    px = np.floor(xy[inside]).astype(int)
    relative = image[px[:, 1], px[:, 0]] / depth[inside] - 1
    visible = np.abs(relative) < 0.02
    assert visible.mean() > 0.7
    assert abs(np.median(relative[visible])) < 1e-4
    assert np.median(np.abs(relative[visible])) < 5e-4
