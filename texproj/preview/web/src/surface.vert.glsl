// Vertex shader of the model. in: position relative to the scene's center, or to that of its node
// (mesh units), normal
// (unit), rgba (sRGB, a = seen) or color (linear, of a glb), value (layer), gloss (roughness and
// metallic), shot (sRGB as photographed, a = seen), tangent (of a glb with a normal map); out: the
// same for the fragment, colors in linear light.
#ifdef LINEAR_COLOR
in vec3 color;
#else
in vec4 rgba;
#endif
in float value;
#ifdef USE_BUMP
in vec4 tangent;
out vec4 vTangent;
#endif
#ifdef RELIT
#ifndef USE_MAP
in vec2 gloss;
in vec4 shot;
#endif
out vec2 vGloss;
out vec4 vShot;
out vec3 vToEye;
#endif
out vec3 vNormal;
out vec3 vPosition;
out vec3 vNormalInView;
out vec3 vPositionInView;
out vec4 vColor;
out float vValue;
flat out float vFlatValue;
out vec2 vUv;

vec3 linearOf(vec3 c) {
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}

void main() {
  vec4 inView = modelViewMatrix * vec4(position, 1.0);
  vNormal = normal;
  vPosition = (modelMatrix * vec4(position, 1.0)).xyz;
  vNormalInView = normalMatrix * normal;
  vPositionInView = inView.xyz;
#ifdef LINEAR_COLOR
  vColor = vec4(color, 1.0);
#else
  vColor = vec4(linearOf(rgba.rgb), rgba.a);
#endif
  vValue = value;
  vFlatValue = value;
#ifdef USE_MAP
  vUv = uv;
#else
  vUv = vec2(0.0);
#endif
#ifdef RELIT
#ifdef USE_MAP
  vGloss = vec2(1.0, 0.0);
  vShot = vec4(0.0);
#else
  vGloss = gloss;
  vShot = vec4(linearOf(shot.rgb), shot.a);
#endif
  vToEye = cameraPosition - (modelMatrix * vec4(position, 1.0)).xyz;
#endif
#ifdef USE_BUMP
  vTangent = tangent;
#endif
  gl_Position = projectionMatrix * inView;
}
