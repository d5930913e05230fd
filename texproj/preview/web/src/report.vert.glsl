#version 300 es
// The model of the report. In: position in the unit cube of its bounding box, place on the page,
// color of the vertex; out: the same for the fragments.
in vec3 position;
in vec2 uv;
in vec3 color;
uniform mat4 clipFromModel;
out vec2 place;
out vec3 tint;

void main() {
  place = uv;
  tint = color;
  gl_Position = clipFromModel * vec4(position, 1.0);
}
