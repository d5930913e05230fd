"""What other programs do with a camera file, written from their formats' definitions alone.

Each function reads one camera of a file's text and projects one point, in plain arithmetic that
shares nothing with texproj; the result is in the format's own pixels turned into ours.
"""

import json
from math import cos, radians, sin
from xml.etree import ElementTree as ET


def times(rows, x):
    return [sum(a * b for a, b in zip(row, x, strict=True)) for row in rows]


def in_rows(values, n):
    values = [float(v) for v in values]
    return [values[i : i + n] for i in range(0, len(values), n)]


def first_row(text):
    return next(line for line in text.splitlines() if not line.startswith("#")).split()


def brown(x, y, k1, k2, k3, along_x, along_y):
    """Radial factor times (x, y), and decentering of strength `along_x`, `along_y`."""
    r2 = x * x + y * y
    factor = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    dx = along_x * (r2 + 2 * x * x) + 2 * along_y * x * y
    dy = along_y * (r2 + 2 * y * y) + 2 * along_x * x * y
    return x * factor + dx, y * factor + dy


def colmap(files, point):
    """format.html: Hamilton quaternion w x y z, world to camera; OPENCV and FULL_OPENCV lenses."""
    camera = first_row(files["cameras.txt"])
    image = first_row(files["images.txt"])
    w, x, y, z = (float(v) for v in image[1:5])
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    q = [a + float(b) for a, b in zip(times(R, point), image[5:8], strict=True)]
    fx, fy, cx, cy, *rest = (float(v) for v in camera[4:])
    k1, k2, p1, p2, k3, k4, k5, k6 = (*rest, *[0.0] * 8)[:8]
    u, v = q[0] / q[2], q[1] / q[2]
    r2 = u * u + v * v
    factor = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    x = u * factor + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
    y = v * factor + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v
    return fx * x + cx, fy * y + cy


def bundler(files, point, size):
    """Bundler User's Manual: P = RX + t, p = -P/P.z, p' = f r(p) p; y up from the middle."""
    lines = files["bundle.out"].splitlines()[2:7]
    f, k1, k2 = (float(v) for v in lines[0].split())
    R = [[float(v) for v in line.split()] for line in lines[1:4]]
    P = [a + float(b) for a, b in zip(times(R, point), lines[4].split(), strict=True)]
    x, y = -P[0] / P[2], -P[1] / P[2]
    r2 = x * x + y * y
    scale = f * (1 + k1 * r2 + k2 * r2 * r2)
    return size[0] / 2 + scale * x, size[1] / 2 - scale * y


def meshlab(files, point):
    """vcg Shot and Camera: Rot (P - centre), depth -z, mm to pixels, y up from the bottom."""
    text = files["cameras.mlp"]
    vcg = ET.fromstring(text[text.index("<MeshLabProject") :]).find(".//VCGCamera").attrib
    rows = in_rows(vcg["RotationMatrix"].split(), 4)[:3]
    minus_center = [float(v) for v in vcg["TranslationVector"].split()][:3]
    local = times([r[:3] for r in rows], [p + c for p, c in zip(point, minus_center, strict=True)])
    depth = -local[2]
    size_x, size_y = (float(v) for v in vcg["PixelSizeMm"].split())
    center_x, center_y = (float(v) for v in vcg["CenterPx"].split())
    height = float(vcg["ViewportPx"].split()[1])
    x = float(vcg["FocalMm"]) * local[0] / depth / size_x + center_x
    y = float(vcg["FocalMm"]) * local[1] / depth / size_y + center_y
    return x, height - y


def metashape(files, point):
    """Metashape manual, frame cameras; transform is 4 x 4 camera to chunk, z forward, y down."""
    root = ET.fromstring(files["cameras.xml"])
    rows = in_rows(root.find(".//camera/transform").text.split(), 4)
    offset = [p - row[3] for p, row in zip(point, rows, strict=False)]
    X, Y, Z = (sum(rows[i][j] * offset[i] for i in range(3)) for j in range(3))
    calibration = root.find(".//calibration")
    c = {e.tag: float(e.text) for e in calibration if e.text and e.text.strip()}
    c = dict.fromkeys(("cx", "cy", "k1", "k2", "k3", "p1", "p2", "b1", "b2"), 0.0) | c
    width, height = (float(calibration.find("resolution").get(key)) for key in ("width", "height"))
    x, y = brown(X / Z, Y / Z, c["k1"], c["k2"], c["k3"], c["p1"], c["p2"])
    u = width * 0.5 + c["cx"] + x * c["f"] + x * c["b1"] + y * c["b2"]
    return u, height * 0.5 + c["cy"] + y * c["f"]


def realityscan(files, point, size):
    """The matrix that RealityCapture's developers gave, heading h, pitch p, roll r."""
    header, row = files["cameras.csv"].splitlines()[:2]
    v = dict(zip(header.split(",")[1:], (float(w) for w in row.split(",")[1:]), strict=True))
    h, p, r = (radians(v[key]) for key in ("heading", "pitch", "roll"))
    R = [
        [cos(r) * cos(h) + sin(r) * sin(p) * sin(h), cos(h) * sin(r) * sin(p) - cos(r) * sin(h),
         -cos(p) * sin(r)],
        [-cos(p) * sin(h), -cos(p) * cos(h), -sin(p)],
        [cos(r) * sin(p) * sin(h) - cos(h) * sin(r), cos(r) * cos(h) * sin(p) + sin(r) * sin(h),
         -cos(r) * cos(p)],
    ]  # fmt: skip
    X, Y, Z = times(R, [a - v[key] for a, key in zip(point, ("x", "y", "alt"), strict=True)])
    longer = max(size)
    x, y = brown(X / Z, Y / Z, v["k1"], v["k2"], v["k3"], v["t2"], v["t1"])
    f = v["f"] * longer / 36
    return size[0] / 2 + v["px"] * longer + f * x, size[1] / 2 + v["py"] * longer + f * y


def nerfstudio(files, point):
    """data_conventions.html: camera to world, OpenGL axes; OpenCV's lens."""
    frame = json.loads(files["transforms.json"])["frames"][0]
    rows = frame["transform_matrix"]
    offset = [p - row[3] for p, row in zip(point, rows, strict=False)]
    X, up, back = (sum(rows[i][j] * offset[i] for i in range(3)) for j in range(3))
    lens = (frame["k1"], frame["k2"], frame["k3"], frame["p2"], frame["p1"])
    x, y = brown(X / -back, -up / -back, *lens)
    return frame["fl_x"] * x + frame["cx"], frame["fl_y"] * y + frame["cy"]
