// Fragment shader of the model. in: surface.vert.glsl; out: sRGB. Modes as in surface.ts.
// Shading: Cook-Torrance with GGX (Walter et al. 2007), Smith's masking in the form of Heitz 2014,
// Schlick's Fresnel; tone mapping: Khronos PBR Neutral.
precision highp float;
#ifdef RELIT                // what only the layers about reflectance need, so that others stay quick
precision highp sampler2DArray;
in vec2 vGloss;
in vec4 vShot;
in vec3 vToEye;
uniform sampler2DArray mirror; // the sky as mirrors of growing roughness show it, over mirrorUnit
uniform float mirrorUnit;   // 0 = dark
uniform mat3 skyFromScan;   // to the right, up, ahead of its picture
#endif
#ifdef USE_BUMP
in vec4 vTangent;
uniform sampler2D bump;     // tangent-space normals
#endif
#ifdef USE_GLOSS
uniform sampler2D orm;      // occlusion, roughness, metallic
#endif
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

// D V: what is mirrored per Fresnel's part, without the cosine.
float lobe(vec3 n, vec3 v, vec3 l, float rough) {
  vec3 h = normalize(v + l);
  float a2 = pow(rough, 4.0);
  float nh = max(dot(n, h), 0.0), nv = max(dot(n, v), 1e-4), nl = max(dot(n, l), 1e-4);
  float d = nh * nh * (a2 - 1.0) + 1.0;
  float distribution = a2 / (PI * d * d);
  return distribution * 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
}

float specular(vec3 n, vec3 v, vec3 l) {
  float fresnel = 0.04 + 0.96 * pow(1.0 - max(dot(v, normalize(v + l)), 0.0), 5.0);
  return lobe(n, v, l, roughness) * fresnel;
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

// The normal of the surface in the scan's axes, as its normal map bends it.
vec3 ownNormal() {
  vec3 n = normalize(vNormal);
#ifdef USE_BUMP
  vec3 right = normalize(vTangent.xyz - n * dot(vTangent.xyz, n));
  vec3 up = cross(n, right) * (vTangent.w < 0.0 ? -1.0 : 1.0);
  vec3 told = 2.0 * texture(bump, vUv).rgb - 1.0;
  n = normalize(told.x * right + told.y * up + told.z * n);
#endif
  return n;
}

#ifdef RELIT
// Occlusion, roughness, metallic.
vec3 surfaceGloss() {
#ifdef USE_GLOSS
  return texture(orm, vUv).rgb;
#else
  return vec3(vValue < 0.0 ? 1.0 : vValue, vGloss);
#endif
}

// What mirrors of that roughness show in a direction. Steps as in skypicture.ts.
vec3 mirrorAt(vec3 d, float rough) {
  const float steps[6] = float[6](0.0, 0.15, 0.3, 0.5, 0.75, 1.0);
  float level = 0.0;
  for (int i = 0; i < 5; i++) level += clamp((rough - steps[i]) / (steps[i + 1] - steps[i]), 0.0, 1.0);
  vec3 s = skyFromScan * d;
  vec2 at = vec2(atan(s.x, s.z) / (2.0 * PI) + 0.5, asin(clamp(s.y, -1.0, 1.0)) / PI + 0.5);
  float lower = min(floor(level), 4.0);
  vec3 sharp = textureLod(mirror, vec3(at, lower), 0.0).rgb;
  return mirrorUnit * mix(sharp, textureLod(mirror, vec3(at, lower + 1.0), 0.0).rgb, level - lower);
}

// F0 times the first, plus the second, is mirrored of even light: B. Karis, "Physically based
// shading on mobile", 2014.
vec2 splitSum(float nv, float rough) {
  vec4 r = rough * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
  float a = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
  return vec2(-1.04, 1.04) * a + r.zw;
}

vec3 relit() {
  vec4 base = surfaceColor();
  if (base.a < 0.5) return unseen();
  vec3 n = ownNormal(), v = normalize(vToEye), gloss = surfaceGloss();
  float open = gloss.r, rough = max(gloss.g, 0.08), metal = gloss.b;
  float nv = max(dot(n, v), 1e-3), nl = max(dot(n, toSun), 0.0);
  vec3 f0 = mix(vec3(0.04), base.rgb, metal);
  vec3 sun = sunlight * nl * sunSeen(normalize(vNormal));
  vec3 light = max(skyLight(n), 0.0) * open + sun;
  vec3 out_ = base.rgb / PI * (1.0 - metal) * light;
  if (nl > 0.0) {
    vec3 h = normalize(v + toSun);
    out_ += lobe(n, v, toSun, rough) * (f0 + (1.0 - f0) * pow(1.0 - max(dot(v, h), 0.0), 5.0)) * sun;
  }
  if (mirrorUnit > 0.0) {
    float seen = clamp(pow(nv + open, exp2(-16.0 * rough - 1.0)) - 1.0 + open, 0.0, 1.0); // Lagarde 2014
    vec2 sums = splitSum(nv, rough);
    out_ += mirrorAt(reflect(-v, n), rough) * (f0 * sums.x + sums.y) * seen;
  }
  return encoded(toned(out_ * metered * exposure));
}
#endif

vec3 picture() {
  vec3 n = normalize(vNormalInView);
  if (mode == 1) return encoded(shaded(n));
  if (mode == 2) return ownNormal() * 0.5 + 0.5;
#ifdef RELIT
  if (mode == 6) return relit();
  if (mode == 8) return vShot.a < 0.5 ? unseen() : encoded(vShot.rgb * exposure);
#ifdef USE_GLOSS
  if (mode == 9) return texture(ramp, vec2(surfaceGloss().g, 0.5)).rgb;
  if (mode == 10) return texture(ramp, vec2(surfaceGloss().b, 0.5)).rgb;
#endif
#endif
  if (mode == 3) return vValue < 0.0 ? unseen() : encoded(vec3(vValue) * exposure);
  if (mode == 4) return vFlatValue < -0.5 ? unseen() : texture(ramp, vec2((vFlatValue + 0.5) / 256.0, 0.5)).rgb;
  if (mode == 5) return vValue <= 0.0 ? unseen() : texture(ramp, vec2(clamp(vValue / span, 0.0, 1.0), 0.5)).rgb;
  if (mode == 7) return vValue < 0.0 ? unseen() : texture(ramp, vec2(clamp(vValue / span, 0.0, 1.0), 0.5)).rgb;
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
