#version 330 core
// Geometry of the mesh as a camera sees it; LENS: with distortion, exact at the vertices.
// in:  xyz_in_local (mesh units, scene offset subtracted), normal_in_world (unit), occlusion (0..1)
// out: position in clip space; normal in camera axes; ambient occlusion
// twin: texproj/render/rays.py
#include "camera.glsl"
#include "lens.glsl"

in vec3 xyz_in_local;

#ifdef NORMAL_AT
in vec3 normal_in_world;
out vec3 normal_in_cam;
#endif
#ifdef AO_AT
in float occlusion;
out float ao;
#endif

void main() {
    vec3 xyz_in_cam = (cam_from_local * vec4(xyz_in_local, 1.0)).xyz;
#ifdef LENS
    xyz_in_cam = distorted(xyz_in_cam);
#endif
    gl_Position = clip_from_cam * vec4(xyz_in_cam, 1.0);
#ifdef NORMAL_AT
    normal_in_cam = mat3(cam_from_local) * normal_in_world;
#endif
#ifdef AO_AT
    ao = occlusion;
#endif
}
