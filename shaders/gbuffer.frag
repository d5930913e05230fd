#version 330 core
// What each pixel sees of the mesh; NAME_AT is the attachment of a channel that was asked for.
// out: depth along the optical axis (mesh units); unit normal in camera axes, as given, not flipped;
//      ambient occlusion (0 hidden .. 1 open); front: 1 where the face is seen from its outside;
//      face: number of the face + 1 in four bytes, lowest first (0 = nothing)
// twin: texproj/render/rays.py

#ifdef DEPTH_AT
layout(location = DEPTH_AT) out float depth;
#endif
#ifdef NORMAL_AT
in vec3 normal_in_cam;
layout(location = NORMAL_AT) out vec4 normal;
#endif
#ifdef AO_AT
in float ao;
layout(location = AO_AT) out float openness;
#endif
#ifdef FRONT_AT
layout(location = FRONT_AT) out float front;
#endif
#ifdef FACE_AT
layout(location = FACE_AT) out vec4 face;
#endif

void main() {
#ifdef DEPTH_AT
    depth = 1.0 / gl_FragCoord.w; // clip w is the depth along the axis
#endif
#ifdef NORMAL_AT
    float size = length(normal_in_cam);
    normal = vec4(size > 0.0 ? normal_in_cam / size : vec3(0.0), 0.0);
#endif
#ifdef AO_AT
    openness = ao;
#endif
#ifdef FRONT_AT
    front = gl_FrontFacing ? 1.0 : 0.0;
#endif
#ifdef FACE_AT
    uint id = uint(gl_PrimitiveID) + 1u;
    face = vec4(id & 255u, (id >> 8) & 255u, (id >> 16) & 255u, id >> 24) / 255.0;
#endif
}
