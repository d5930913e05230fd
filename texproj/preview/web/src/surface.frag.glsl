// Fragment shader of the model. in: surface.vert.glsl; out: sRGB. Modes as in surface.ts.
// Shading: Cook-Torrance with GGX (Walter et al. 2007), Smith's masking in the form of Heitz 2014,
// Schlick's Fresnel; tone mapping: Khronos PBR Neutral.
precision highp float;
in vec3 vNormal;
in vec3 vPosition;
in vec3 vNormalInView;
in vec3 vPositionInView;
in vec4 vColor;
in float vValue;
flat in float vFlatValue;
in vec2 vUv;
uniform int mode;
uniform float exposure;     // factor on linear light
uniform vec3 light;         // unit, to the light, view axes
uniform float roughness;
uniform float span;         // value that the end of the ramp stands for
uniform sampler2D ramp;     // 256 x 1 colors of values, sRGB as stored
uniform vec3 sky[9];         // irradiance of an open surface, spherical harmonics
uniform vec3 toSun;         // unit, scan's axes
uniform vec3 sunlight;      // irradiance square to the sun
uniform float metered;      // exposure as a camera meters
uniform int tone;           // 0 none, 1 Reinhard, 2 filmic, 3 ACES
uniform bool shadowed;
uniform sampler2D depths;   // as the sun sees the model
uniform mat4 shadowMatrix;
uniform float radius;       // of the scene
#ifdef USE_MAP
uniform sampler2D map;
#endif
out vec4 pixel;

const float PI = 3.14159265;
const vec3 ALBEDO = vec3(0.55);

vec3 encoded(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

vec3 toneMapped(vec3 c) {
  float x = min(c.r, min(c.g, c.b));
  c -= x < 0.08 ? x - 6.25 * x * x : 0.04;
  float peak = max(c.r, max(c.g, c.b));
  const float start = 0.76;
  if (peak < start) return c;
  float d = 1.0 - start;
  float newPeak = 1.0 - d * d / (peak + d - start);
  float g = 1.0 - 1.0 / (0.15 * (peak - newPeak) + 1.0);
  return mix(c * newPeak / peak, vec3(newPeak), g);
}

float specular(vec3 n, vec3 v, vec3 l) {
  vec3 h = normalize(v + l);
  float a2 = pow(roughness, 4.0);
  float nh = max(dot(n, h), 0.0), nv = max(dot(n, v), 1e-4), nl = max(dot(n, l), 1e-4);
  float d = nh * nh * (a2 - 1.0) + 1.0;
  float distribution = a2 / (PI * d * d);
  float masking = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
  float fresnel = 0.04 + 0.96 * pow(1.0 - max(dot(v, h), 0.0), 5.0);
  return distribution * masking * fresnel;
}

vec3 shaded(vec3 n) {
  vec3 v = normalize(-vPositionInView);
  float nl = max(dot(n, light), 0.0);
  vec3 direct = (ALBEDO / PI + specular(n, v, light)) * nl * 3.0;
  vec3 ambient = ALBEDO * (0.13 + 0.07 * n.y);
  return toneMapped((direct + ambient) * exposure);
}

// Where no photo looked: a quiet hatch, so that it is never taken for a dark surface.
vec3 unseen() {
  float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 12.0));
  return vec3(mix(0.20, 0.25, stripe));
}

vec4 surfaceColor() {
#ifdef USE_MAP
  return texture(map, vUv);
#elif defined(UNSEEN)
  return vec4(0.0);
#else
  return vColor;
#endif
}

// Twin: relight.ts irradiance; order as in texproj/appearance/harmonics.py.
vec3 skyLight(vec3 n) {
  vec3 e = 0.28209479 * sky[0] + 0.48860251 * (n.y * sky[1] + n.z * sky[2] + n.x * sky[3]);
  e += 1.09254843 * (n.x * n.y * sky[4] + n.y * n.z * sky[5] + n.x * n.z * sky[7]);
  return e + 0.31539157 * (3.0 * n.z * n.z - 1.0) * sky[6] + 0.54627422 * (n.x * n.x - n.y * n.y) * sky[8];
}

// Part of the sun that is seen from here: nine looks at the picture of depths.
float sunSeen(vec3 n) {
  if (!shadowed) return 1.0;
  float texel = 1.0 / float(textureSize(depths, 0).x);
  vec3 p = (shadowMatrix * vec4(vPosition + n * radius * 4.0 * texel, 1.0)).xyz;
  float seen = 0.0;
  for (int i = -1; i <= 1; i++)
    for (int j = -1; j <= 1; j++)
      seen += step(p.z - 5e-4, texture(depths, p.xy + vec2(i, j) * texel).r);
  return seen / 9.0;
}

vec3 hable(vec3 x) {
  return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3;
}

// Twin: texproj/appearance/relight/tone.py.
vec3 toned(vec3 x) {
  if (tone == 1) return x * (1.0 + x / 16.0) / (1.0 + x);
  if (tone == 2) return hable(2.0 * x) / hable(vec3(11.2));
  if (tone == 3) return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
  return x;
}

vec3 relit() {
  vec4 base = surfaceColor();
  if (base.a < 0.5) return unseen();
  vec3 n = normalize(vNormal);
  float open = vValue < 0.0 ? 1.0 : vValue;
  vec3 light = max(skyLight(n), 0.0) * open + sunlight * max(dot(n, toSun), 0.0) * sunSeen(n);
  return encoded(toned(base.rgb / PI * light * metered * exposure));
}

vec3 picture() {
  vec3 n = normalize(vNormalInView);
  if (mode == 1) return encoded(shaded(n));
  if (mode == 2) return normalize(vNormal) * 0.5 + 0.5;
  if (mode == 3) return vValue < 0.0 ? unseen() : encoded(vec3(vValue) * exposure);
  if (mode == 4) return vFlatValue < -0.5 ? unseen() : texture(ramp, vec2((vFlatValue + 0.5) / 256.0, 0.5)).rgb;
  if (mode == 5) return vValue <= 0.0 ? unseen() : texture(ramp, vec2(clamp(vValue / span, 0.0, 1.0), 0.5)).rgb;
  if (mode == 7) return vValue < 0.0 ? unseen() : texture(ramp, vec2(clamp(vValue / span, 0.0, 1.0), 0.5)).rgb;
  if (mode == 6) return relit();
  vec4 color = surfaceColor();
  return color.a < 0.5 ? unseen() : encoded(color.rgb * exposure);
}

// Backs of faces are dark in every layer, so that nobody picks there or takes them for the surface.
vec3 behind() {
  vec3 n = normalize(-vNormalInView);
  return vec3(0.05 + 0.05 * max(n.z, 0.0));
}

void main() {
  pixel = vec4(gl_FrontFacing ? picture() : behind(), 1.0);
}
