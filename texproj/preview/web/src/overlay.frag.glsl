// A photo over the view from its own camera. Each screen pixel's ideal ray goes forward through
// the lens model (closed form, as OpenCV's), so the photo lies on the pinhole view exactly.
// in: vScreen 0..1 over the view, y up; out: sRGB with opacity. Twin: lens.ts distort.
precision highp float;
in vec2 vScreen;
uniform vec4 sides;         // left, right, bottom, top of the view as tangents, y up
uniform vec2 focal;         // pixels
uniform vec2 principal;     // pixels from the photo's corner
uniform vec2 size;          // pixels
uniform float dist[12];     // k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4; fisheye: k1 k2 k3 k4 p1 p2 s1 s2
uniform bool fisheye;
uniform float maxRadius2;
uniform float opacity;
uniform float wipe;         // the photo shows left of this part of the view's width
uniform float exposure;
uniform sampler2D photo;    // decoded to linear light by the sampler, first row on top
out vec4 pixel;

vec3 encoded(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

vec2 bentPerspective(vec2 p) {
  float r2 = dot(p, p);
  float radial = (1.0 + r2 * (dist[0] + r2 * (dist[1] + r2 * dist[4])))
    / (1.0 + r2 * (dist[5] + r2 * (dist[6] + r2 * dist[7])));
  vec2 tangential = vec2(
    2.0 * dist[2] * p.x * p.y + dist[3] * (r2 + 2.0 * p.x * p.x),
    dist[2] * (r2 + 2.0 * p.y * p.y) + 2.0 * dist[3] * p.x * p.y);
  vec2 prism = r2 * (vec2(dist[8], dist[10]) + r2 * vec2(dist[9], dist[11]));
  return p * radial + tangential + prism;
}

vec2 bentFisheye(vec2 p) {
  float r = length(p);
  vec2 u = r > 0.0 ? p * (atan(r) / r) : p;
  float t2 = dot(u, u);
  float radial = 1.0 + t2 * (dist[0] + t2 * (dist[1] + t2 * (dist[2] + t2 * dist[3])));
  vec2 tangential = vec2(
    2.0 * dist[4] * u.x * u.y + dist[5] * (t2 + 2.0 * u.x * u.x),
    2.0 * dist[5] * u.x * u.y + dist[4] * (t2 + 2.0 * u.y * u.y));
  return u * radial + tangential + t2 * vec2(dist[6], dist[7]);
}

void main() {
  vec2 p = vec2(mix(sides.x, sides.y, vScreen.x), -mix(sides.z, sides.w, vScreen.y));
  float r2 = dot(p, p);
  vec2 uv = ((fisheye ? bentFisheye(p) : bentPerspective(p)) * focal + principal) / size;
  vec4 color = texture(photo, uv);
  bool outside = r2 >= maxRadius2 || any(lessThan(uv, vec2(0.0))) || any(greaterThan(uv, vec2(1.0)));
  if (outside || vScreen.x > wipe) discard;
  pixel = vec4(encoded(color.rgb * exposure), opacity);
}
