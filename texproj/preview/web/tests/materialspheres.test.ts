import assert from "node:assert/strict";
import { test } from "node:test";
import { ggx, shaded } from "../src/materialspheres.ts";

test("the highlight is that of texproj/appearance/flash/reflection.py", () => {
  assert.ok(Math.abs(ggx(0.4, 0.9, 0.8, 0.95) - 0.19353996) < 1e-5);
  assert.ok(Math.abs(ggx(0.9, 0.5, 0.6, 0.7) - 0.15758672) < 1e-5);
});

test("a smooth metal has a brighter highlight than a rough one, and no matte part", () => {
  const metal = { base_color: [0.9, 0.6, 0.3], metallic: true, f0: null } as const;
  const brightest = (roughness: number) => {
    let top = 0;
    for (let i = -19; i < 20; i++) for (let j = -19; j < 20; j++) {
      const [x, y] = [i / 20, j / 20];
      if (x * x + y * y < 1) top = Math.max(top, shaded({ ...metal, base_color: [...metal.base_color], roughness }, [x, y, Math.sqrt(1 - x * x - y * y)])[0]);
    }
    return top;
  };
  assert.ok(brightest(0.25) > 3 * brightest(0.6));
  const away = shaded({ ...metal, base_color: [...metal.base_color], roughness: 0.2 }, [0.9, -0.3, Math.sqrt(1 - 0.81 - 0.09)]);
  assert.ok(away[0] < 0.9 && Math.abs(away[0] / away[2] - 3) < 2);
});
