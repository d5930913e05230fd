"""Meshes that bring texture coordinates, written as their formats define it, and read again by the
standard library alone.
"""

import io
import json
import struct

import numpy as np
from PIL import Image


def image(color, size=(32, 32), kind="PNG"):
    out = io.BytesIO()
    Image.new("RGB", size, color).save(out, kind)
    return out.getvalue()


def glb(nodes, meshes, materials, images=(), roots=(0,)):
    """The bytes of a glb. meshes: (name, primitives); a primitive: (xyz, uv or None, faces,
    material); materials: (name, number of an image or None); images: bytes of png files.
    """
    blob, views, accessors = bytearray(), [], []

    def view(data):
        blob.extend(bytes(-len(blob) % 4))
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob.extend(data)
        return len(views) - 1

    def accessor(values, kind, component):
        entry = {"bufferView": view(values.tobytes()), "componentType": component}
        accessors.append(entry | {"count": len(values), "type": kind})
        return len(accessors) - 1

    def primitive(xyz, uv, faces, material):
        attributes = {"POSITION": accessor(np.asarray(xyz, "<f4"), "VEC3", 5126)}
        if uv is not None:
            attributes["TEXCOORD_0"] = accessor(np.asarray(uv, "<f4"), "VEC2", 5126)
        entry = {"attributes": attributes}
        entry["indices"] = accessor(np.asarray(faces, "<u4").ravel(), "SCALAR", 5125)
        return entry if material is None else entry | {"material": material}

    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(roots)}],
        "nodes": nodes,
        "meshes": [{"name": n, "primitives": [primitive(*p) for p in ps]} for n, ps in meshes],
        "materials": [
            {"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": number}}}
            if number is not None
            else {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}}
            for name, number in materials
        ],
        "images": [{"mimeType": "image/png", "bufferView": view(data)} for data in images],
    }
    content["textures"] = [{"source": i} for i in range(len(images))]
    content |= {"bufferViews": views, "accessors": accessors}
    content["buffers"] = [{"byteLength": len(blob)}]
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    blob.extend(bytes(-len(blob) % 4))
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
    parts = struct.pack("<I4s", len(text), b"JSON"), text
    return head + b"".join(parts) + struct.pack("<I4s", len(blob), b"BIN\0") + bytes(blob)


class Read:
    """A glb taken apart."""

    def __init__(self, path):
        data = path.read_bytes()
        length = struct.unpack("<I", data[12:16])[0]
        self.content = json.loads(data[20 : 20 + length])
        self.blob = data[28 + length :]

    def accessor(self, number):
        entry = self.content["accessors"][number]
        view = self.content["bufferViews"][entry["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[entry["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[entry["type"]]
        data = np.frombuffer(self.blob, kind, entry["count"] * width, view.get("byteOffset", 0))
        return data.reshape(-1, width)

    def node(self, name):
        (found,) = [n for n in self.content["nodes"] if n["name"] == name]
        return found

    def corners(self, name):
        """By material: ((n, 3, 3) positions in the frame of the node, (n, 3, 2) coordinates)."""
        out = {}
        for primitive in self.content["meshes"][self.node(name)["mesh"]]["primitives"]:
            at = self.accessor(primitive["indices"]).reshape(-1, 3)
            attributes = primitive["attributes"]
            material = self.content["materials"][primitive["material"]]["name"]
            uv = attributes.get("TEXCOORD_0")
            out[material] = (
                self.accessor(attributes["POSITION"])[at],
                None if uv is None else self.accessor(uv)[at],
            )
        return out

    def picture(self, material):
        """(h, w, 3) uint8 image of a material."""
        (entry,) = [m for m in self.content["materials"] if m["name"] == material]
        texture = entry["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        return np.asarray(Image.open(io.BytesIO(self.image(texture))).convert("RGB"))

    def image(self, texture):
        """The bytes of the image of a texture."""
        image = self.content["images"][self.content["textures"][texture]["source"]]
        view = self.content["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        return self.blob[start : start + view["byteLength"]]
