// A triangle that covers the view. in: position = clip xy; out: vScreen 0..1 over the view, y up.
out vec2 vScreen;

void main() {
  vScreen = position.xy * 0.5 + 0.5;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}
