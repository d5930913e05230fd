// What others make of glb files: the glTF validator of Khronos, and the Draco decoder of three.js.
// node glb_check.mjs WEB validate|draco FILE ... -> one line of JSON
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [web, task, ...files] = process.argv.slice(2);
const require = createRequire(`${web}/package.json`);

async function validated(data) {
  const { issues } = await require("gltf-validator").validateBytes(new Uint8Array(data));
  return issues.messages.filter(({ severity }) => severity < 2).map(({ code, pointer, message, severity }) =>
    ({ code, pointer, message, severity }));
}

async function decoded(data, draco) {
  const length = data.readUInt32LE(12);
  const content = JSON.parse(data.subarray(20, 20 + length));
  const binary = data.subarray(28 + length);
  return content.meshes.flatMap(({ primitives }) => primitives).map((primitive) => {
    const told = primitive.extensions.KHR_draco_mesh_compression;
    const { byteOffset, byteLength } = content.bufferViews[told.bufferView];
    const bytes = new Int8Array(binary.subarray(byteOffset, byteOffset + byteLength));
    const decoder = new draco.Decoder(), buffer = new draco.DecoderBuffer(), mesh = new draco.Mesh();
    buffer.Init(bytes, bytes.length);
    if (!decoder.DecodeBufferToMesh(buffer, mesh).ok()) throw new Error("draco");
    const values = Object.entries(told.attributes).map(([name, id]) => {
      const array = new draco.DracoFloat32Array();
      decoder.GetAttributeFloatForAllPoints(mesh, decoder.GetAttributeByUniqueId(mesh, id), array);
      return [name, Array.from({ length: array.size() }, (_, i) => array.GetValue(i))];
    });
    const face = new draco.DracoInt32Array();
    const faces = Array.from({ length: mesh.num_faces() }, (_, i) => {
      decoder.GetFaceFromMesh(mesh, i, face);
      return [0, 1, 2].map((k) => face.GetValue(k));
    });
    return { material: primitive.material, faces, points: mesh.num_points(), ...Object.fromEntries(values) };
  });
}

async function threesDecoder() {
  const text = readFileSync(`${web}/node_modules/three/examples/jsm/libs/draco/gltf/draco_decoder.js`, "utf8");
  return new Function("require", "__dirname", `${text}; return DracoDecoderModule`)(require, web)();
}

const draco = task === "draco" ? await threesDecoder() : null;
const out = [];
for (const file of files) out.push(await (draco ? decoded : validated)(readFileSync(file), draco));
console.log(JSON.stringify(out));
