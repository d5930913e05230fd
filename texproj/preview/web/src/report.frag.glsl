#version 300 es
// Colors as they were photographed: of the page where there is one, else of the vertices.
precision highp float;
in vec2 place;
in vec3 tint;
uniform sampler2D page;
uniform bool textured;
out vec4 shown;

void main() {
  shown = vec4(textured ? texture(page, place).rgb : tint, 1.0);
}
