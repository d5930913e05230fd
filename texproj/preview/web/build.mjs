// Bundles the page into ../static/bundle (or the folder given): index.html, app.js, app.css, icon.svg, report.js.
import { build } from "esbuild";
import { copyFile, mkdir } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "..", "static", "bundle");

await mkdir(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { app: "src/main.ts", report: "src/report.ts" },
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  legalComments: "inline",
  outdir: out,
  loader: { ".glsl": "text" },
});
for (const name of ["index.html", "icon.svg"]) {
  await copyFile(join(here, name), join(out, name));
}
