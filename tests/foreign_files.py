"""What other programs do with a set of camera files, written from their formats' definitions alone.

Each function takes the files of a folder by name, and a point; it projects the point by the first
camera with a pose, in plain arithmetic that shares nothing with texproj, and returns our pixels.
"""

import json
import struct
from math import atan, atan2, cos, hypot, pi, radians, sin, sqrt
from urllib.parse import unquote
from xml.etree import ElementTree as ET

from foreign import brown, in_rows, times


def transposed(rows):
    return [list(column) for column in zip(*rows, strict=True)]


def product(*matrices):
    first, *rest = matrices
    for other in rest:
        first = transposed([times(first, column) for column in transposed(other)])
    return first


def about(axis, degrees):
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return {"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]  # fmt: skip


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def seen_down_z(q, f, c, lens=(0, 0, 0, 0, 0)):
    """Pixel of a point in a camera that looks along z with y down; lens: k1 k2 k3, then what the
    decentering along x and along y multiplies.
    """
    x, y = brown(q[0] / q[2], q[1] / q[2], *lens)
    return f[0] * x + c[0], f[1] * y + c[1]


def seen_down_minus_z(q, f, c, lens=(0, 0, 0, 0, 0)):
    """The same for a camera that looks along -z with y up."""
    return seen_down_z((q[0], -q[1], -q[2]), f, c, lens)


def seen_round(q, matrix, c, polynomial):
    """Pixel of a point in Pix4D's and Bentley's fisheye that looks along z with y down: theta is
    2 / pi arctan(R / z), rho = p0 + p1 theta + ..., then a matrix by rows.
    """
    far = hypot(q[0], q[1])
    theta = 2 / pi * atan2(far, q[2])
    rho = sum(p * theta**i for i, p in enumerate(polynomial))
    x, y = rho * q[0] / far, rho * q[1] / far
    return matrix[0] * x + matrix[1] * y + c[0], matrix[2] * x + matrix[3] * y + c[1]


def only(files, ending):
    return next(content for name, content in sorted(files.items()) if name.endswith(ending))


def opensfm(files, point, size):
    """geometry.html: world to camera by an axis-angle; the picture's middle is 0, its longer side
    1; a pixel's index is half a pixel less than its middle.
    """
    part = json.loads(only(files, ".json"))[0]
    shot = next(iter(part["shots"].values()))
    lens = part["cameras"][shot["camera"]]
    axis = shot["rotation"]
    angle = sqrt(sum(a * a for a in axis))
    k = [a / angle for a in axis]
    along = sum(a * b for a, b in zip(k, point, strict=True))
    across = (k[1] * point[2] - k[2] * point[1], k[2] * point[0] - k[0] * point[2],
              k[0] * point[1] - k[1] * point[0])  # fmt: skip
    q = [
        p * cos(angle) + a * sin(angle) + n * along * (1 - cos(angle)) + t
        for p, a, n, t in zip(point, across, k, shot["translation"], strict=True)
    ]
    bent = (lens["k1"], lens["k2"], lens["k3"], lens["p2"], lens["p1"])
    u, v = seen_down_z(q, (lens["focal_x"], lens["focal_y"]), (lens["c_x"], lens["c_y"]), bent)
    index = u * max(size) - 0.5 + size[0] / 2, v * max(size) - 0.5 + size[1] / 2
    return index[0] + 0.5, index[1] + 0.5


def blocks_exchange(files, point, size):
    """The User Guide's comments: R world to camera, axes by CameraOrientation; the origin of pixels
    is the center of the first one.
    """
    group = ET.fromstring(only(files, ".xml")).find("Block/Photogroups/Photogroup")

    def value(path, default=None):
        text = group.findtext(path, default)
        return None if text is None else float(text)

    pose = group.find("Photo/Pose")
    turn = pose.find("Rotation")
    if turn.find("Omega") is not None:
        omega, phi, kappa = (float(turn.findtext(key)) for key in ("Omega", "Phi", "Kappa"))
        R = transposed(product(about("x", omega), about("y", phi), about("z", kappa)))
    else:
        R = [[float(turn.findtext(f"M_{i}{j}")) for j in range(3)] for i in range(3)]
    q = times(R, minus(point, [float(pose.findtext(f"Center/{axis}")) for axis in "xyz"]))
    if group.findtext("CameraModelType") == "Fisheye":
        matrix = [value(f"FisheyeFocalMatrix/M_{i}{j}") for i in (0, 1) for j in (0, 1)]
        down = q if group.findtext("CameraOrientation") == "XRightYDown" else (q[0], -q[1], -q[2])
        center = value("PrincipalPoint/x") + 0.5, value("PrincipalPoint/y") + 0.5
        terms = [value(f"FisheyeDistortion/P{i}") for i in range(5)]
        return seen_round(down, matrix, center, terms)
    f = value("FocalLengthPixels")
    f = value("FocalLength") / value("SensorSize") * max(size) if f is None else f
    lens = [value(f"Distortion/{key}") for key in ("K1", "K2", "K3", "P2", "P1")]
    see = {"XRightYDown": seen_down_z, "XRightYUp": seen_down_minus_z}
    seen = see[group.findtext("CameraOrientation")]
    center = value("PrincipalPoint/x"), value("PrincipalPoint/y")
    u, v = seen(q, (f, f * value("AspectRatio", "1")), center, lens)
    return u + 0.5, v + 0.5


def pix4d(files, point, size):
    """The file's own header: m = K [R | -R t] X."""
    lines = [line for line in only(files, "parameters.txt").splitlines() if line.strip()][8:]
    K = [[float(word) for word in line.split()] for line in lines[:3]]
    r1, r2, r3 = (float(word) for word in lines[3].split())
    t1, t2 = (float(word) for word in lines[4].split())
    t, *R = ([float(word) for word in line.split()] for line in lines[5:9])
    q = times(R, minus(point, t))
    return seen_down_z(q, (K[0][0], K[1][1]), (K[0][2], K[1][2]), (r1, r2, r3, t2, t1))


def opf(files, point, size):
    """calibrated_cameras.html: Rx(omega) Ry(phi) Rz(kappa) from right-top-back axes."""
    project = json.loads(only(files, ".opf"))
    uris = {r["format"]: unquote(r["uri"]) for item in project["items"] for r in item["resources"]}
    content = json.loads(files[uris["application/opf-calibrated-cameras+json"]])
    camera = content["cameras"][0]
    lens = next(s for s in content["sensors"] if s["id"] == camera["sensor_id"])["internals"]
    turn = zip("xyz", camera["orientation_deg"], strict=True)
    R = product(*(about(axis, angle) for axis, angle in turn))
    q = times(transposed(R), minus(point, camera["position"]))
    if lens["type"] == "fisheye":
        down = (q[0], -q[1], -q[2])
        return seen_round(down, lens["affine"], lens["principal_point_px"], lens["polynomial"])
    (p1, p2), f = lens["tangential_distortion"], lens["focal_length_px"]
    bent = (*lens["radial_distortion"], p2, p1)
    return seen_down_minus_z(q, (f, f), lens["principal_point_px"], bent)


def visualsfm(files, point, size):
    """doc.html#nvm and PBA: R by a quaternion w x y z, center; the ideal point is the measured one
    times 1 + k m^2, found here by bisection.
    """
    lines = [line for line in only(files, ".nvm").splitlines() if line.strip()]
    f, w, x, y, z, *center, k, _ = (float(word) for word in lines[2].split()[1:])
    n = sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / n, x / n, y / n, z / n
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    q = times(R, minus(point, center))
    u, v = q[0] / q[2], q[1] / q[2]
    ideal, low, high = hypot(u, v), 0.0, 2.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if middle * (1 + k * middle**2) < ideal else (low, middle)
    return size[0] / 2 + f * u / ideal * low, size[1] / 2 + f * v / ideal * low


def texrecon(files, point, size):
    """MVE's CameraInfo: world to camera, focal length by the longer side of square pixels."""
    outer, inner = (
        [float(word) for word in line.split()] for line in only(files, ".cam").splitlines()[:2]
    )
    q = [a + b for a, b in zip(times(in_rows(outer[3:], 3), point), outer[:3], strict=True)]
    f, d0, d1, aspect, px, py = (*inner, *(1, 0, 0, 1, 0.5, 0.5)[len(inner) :])
    width, height = size
    square = width / height * aspect
    across = height / aspect if square < 1 else width
    down = height if square < 1 else width * aspect
    return seen_down_z(
        q, (f * across, f * down), (width * px, height * py), (d0, d1, 0, 0, 0)
    )  # fmt: skip


def micmac(files, point, size):
    """Lines of camera to world; the ideal pixel is bent about CDist, radii in pixels."""
    ori = next(v for k, v in sorted(files.items()) if k.startswith("Orientation-"))
    tag = lambda text, name: text.split(f"<{name}>")[1].split(f"</{name}>")[0]  # noqa: E731
    row = lambda text, name: [float(w) for w in tag(text, name).split()]  # noqa: E731
    lens = files[tag(ori, "FileInterne").strip().rsplit("/", 1)[-1]]
    c = row(ori, "Centre")
    d = [p - q for p, q in zip(point, c, strict=True)]
    turn = [row(ori, f"L{i}") for i in (1, 2, 3)]
    q = [sum(turn[i][j] * d[i] for i in range(3)) for j in range(3)]
    (f,), (px, py) = row(lens, "F"), row(lens, "PP")
    if "<ModUnif>" in lens:
        ideal = px + f * q[0] / q[2], py + f * q[1] / q[2]
        return micmac_round(ideal, "EquiSolid" in lens, row(lens, "Etats")[0], lens)
    mx, my = row(lens, "CDist")
    x, y = px + f * q[0] / q[2] - mx, py + f * q[1] / q[2] - my
    r2 = x * x + y * y
    terms = [float(part.split("<")[0]) for part in lens.split("<CoeffDist>")[1:]]
    scale = 1 + sum(k * r2 ** (i + 1) for i, k in enumerate(terms))
    p1, p2, b1, b2 = (
        row(lens, k)[0] if f"<{k}>" in lens else 0.0 for k in ("P1", "P2", "b1", "b2")
    )
    u = x * scale + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y
    v = y * scale + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    return mx + u, my + v


def micmac_round(ideal, equisolid, f, lens):
    """phgr_ebner_brown_dist.cpp: an ideal pixel to the plane of angles, 10 radial terms, pairs
    and 2 terms of first degree.
    """
    told = [float(part.split("<")[0]) for part in lens.split("<Params>")[1:]]
    a, b = (ideal[0] - told[0]) / f, (ideal[1] - told[1]) / f
    r = hypot(a, b)
    angle = 2 * sin(atan(r) / 2) if equisolid else atan(r)
    x, y = a * angle / r, b * angle / r
    r2 = x * x + y * y
    radial = 1 + sum(k * r2 ** (i + 1) for i, k in enumerate(told[2:12]))
    p, q = told[12:14]
    assert not any(told[14:22])
    u = x * (radial + told[22]) + y * told[23] + p * (r2 + 2 * x * x) + 2 * q * x * y
    v = y * radial + x * told[23] + q * (r2 + 2 * y * y) + 2 * p * x * y
    return told[0] + f * u, told[1] + f * v


def arkit(files, point, size):
    """ARCamera: camera to world, the camera looks along -z with y up."""
    frame = json.loads(only(files, ".json"))
    if "t_00" in frame:
        rows = [[frame[f"t_{i}{j}"] for j in range(4)] for i in range(3)]
        f, c = (frame["fx"], frame["fy"]), (frame["cx"], frame["cy"])
    else:
        rows = in_rows(frame["cameraPoseARFrame"], 4)[:3]
        K = in_rows(frame["intrinsics"], 3)
        f, c = (K[0][0], K[1][1]), (K[0][2], K[1][2])
    offset = minus(point, [row[3] for row in rows])
    return seen_down_minus_z(times(transposed([row[:3] for row in rows]), offset), f, c)


def table(files, point, size):
    """Metashape's columns: omega, phi, kappa, or yaw, pitch, roll of a camera that looks down with
    its top to the north where all are 0; without a lens, 1 longer side and the middle.
    """
    lines = [line for line in only(files, ("txt", "csv")).splitlines() if "System" not in line]
    mark = next(mark for mark in (",", "\t", None) if mark is None or mark in lines[0])
    names = [name.strip("#").split("/")[0].lower() for name in lines[0].split(mark)]
    row = dict(zip(names, lines[1].split(mark), strict=False))
    get = {name: float(row[name]) for name in names if name in row and name not in NAMES}
    if "omega" in get:
        R = product(about("x", get["omega"]), about("y", get["phi"]), about("z", get["kappa"]))
    else:
        R = product(about("z", -get["yaw"]), about("x", get["pitch"]), about("y", get["roll"]))
    q = times(transposed(R), minus(point, [get[axis] for axis in "xyz"]))
    f = get.get("f_px", max(size))
    return seen_down_minus_z(q, (f, f), (size[0] / 2, size[1] / 2))


NAMES = ("name", "photoid", "imagename", "label")


def openmvs(files, point, size):
    """Interface.h: R (X - C) of the platform's pose, then of the camera on it; integer pixels are
    centers.
    """
    data, at = only(files, ".mvs"), 12

    def take(kinds):
        nonlocal at
        values = struct.unpack_from(f"<{kinds}", data, at)
        at += struct.calcsize(f"<{kinds}")
        return values

    def text():
        nonlocal at
        length = take("Q")[0]
        at += length

    take("Q")
    text()
    take("Q")
    text()
    text()
    take("II")
    K, R_on, C_on = take("9d"), take("9d"), take("3d")
    take("Q")
    R, C = take("9d"), take("3d")
    q = times(in_rows(R_on, 3), minus(times(in_rows(R, 3), minus(point, C)), C_on))
    return K[0] * q[0] / q[2] + K[2] + 0.5, K[4] * q[1] / q[2] + K[5] + 0.5


def openmvg(files, point, size):
    """SfM_data: R (X - C); pinhole_brown_t2 with t1, t2 as OpenCV's p1, p2."""
    content = json.loads(only(files, ".json"))
    pose = content["extrinsics"][0]["value"]
    lens = content["intrinsics"][0]["value"]["ptr_wrapper"]["data"]
    q = times(pose["rotation"], minus(point, pose["center"]))
    k1, k2, k3, t1, t2 = lens["disto_t2"]
    f = lens["focal_length"]
    return seen_down_z(q, (f, f), lens["principal_point"], (k1, k2, k3, t2, t1))


def meshroom(files, point, size):
    """jsonIO.cpp, version 1.2.6: columns of R, offset from the middle, mm of a sensor's width."""
    content = json.loads(only(files, ".sfm"))
    pose = content["poses"][0]["pose"]["transform"]
    lens = content["intrinsics"][0]
    R = transposed(in_rows(pose["rotation"], 3))
    q = times(R, minus(point, [float(word) for word in pose["center"]]))
    width, height = float(lens["width"]), float(lens["height"])
    f = float(lens["focalLength"]) / float(lens["sensorWidth"]) * width
    x, y = (float(word) for word in lens["principalPoint"])
    k1, k2, k3, t1, t2 = (float(word) for word in lens["distortionParams"])
    return seen_down_z(q, (f, f), (width / 2 + x, height / 2 + y), (k1, k2, k3, t2, t1))


def realityscan_xmp(files, point, size):
    """ "RealityCapture XMP camera math": R, position, all lengths by the longer side."""
    root = ET.fromstring(only(files, ".xmp"))
    values = {}
    for element in root.iter():
        values |= {key.rpartition("}")[2]: text for key, text in element.attrib.items()}
        values[element.tag.rpartition("}")[2]] = element.text
    R = in_rows(values["Rotation"].split(), 3)
    q = times(R, minus(point, [float(word) for word in values["Position"].split()]))
    longer, aspect = max(size), float(values["AspectRatio"])
    f = float(values["FocalLength35mm"]) / 36 * longer
    u, v = (float(values[f"PrincipalPoint{axis}"]) * longer for axis in "UV")
    k1, k2, k3, _, t1, t2 = (float(word) for word in values["DistortionCoeficients"].split())
    center = size[0] / 2 + u, size[1] / 2 + v
    return seen_down_z(q, (f, f * aspect), center, (k1, k2, k3, t2, t1))


def metashape_old(files, point, size):
    """Agisoft Lens manual 0.4: fx, fy and the principal point from the corner; P2 (r^2 + 2 x^2)."""
    root = ET.fromstring(only(files, ".xml"))
    rows = in_rows(root.find(".//camera/transform").text.split(), 4)[:3]
    q = times(transposed([row[:3] for row in rows]), minus(point, [row[3] for row in rows]))
    c = {e.tag: float(e.text) for e in root.find(".//calibration") if e.text and e.text.strip()}
    lens = (c["k1"], c["k2"], c["k3"], c["p2"], c["p1"])
    return seen_down_z(q, (c["fx"], c["fy"]), (c["cx"], c["cy"]), lens)


def nerfstudio_poses(files, point, size):
    """exporter.py and base_dataparser.py: training = scale * (T original), camera to world."""
    made = json.loads(files["dataparser_transforms.json"])
    lens = json.loads(files["transforms.json"])
    rows = json.loads(files["transforms_train.json"])[0]["transform"]
    there = [a + row[3] for a, row in zip(
        times([row[:3] for row in made["transform"]], point), made["transform"], strict=True
    )]  # fmt: skip
    offset = minus([made["scale"] * a for a in there], [row[3] for row in rows])
    q = times(transposed([row[:3] for row in rows]), offset)
    bent = (lens["k1"], lens["k2"], 0, lens["p2"], lens["p1"])
    return seen_down_minus_z(q, (lens["fl_x"], lens["fl_y"]), (lens["cx"], lens["cy"]), bent)


blocks_exchange_fisheye = blocks_exchange
