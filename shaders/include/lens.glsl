// The distortion of a photo's lens: OpenCV's model with all its coefficients, or a fisheye, 32 bit.
// From render/blocks.py::lens_block. Twin: Intrinsics.distort in texproj/camera.py.
// Normalized coordinates (x/z, y/z) in and out. The model holds up to radius `lens_limit`, just
// beyond the picture; farther out it continues straight, so that it never folds back.
layout(std140) uniform Lens {
    vec4 lens_k1_k2_p1_p2;
    vec4 lens_k3_k4_k5_k6;
    vec4 lens_s1_s2_s3_s4;
    mat4 lens_tilt;
    float lens_limit;
    float lens_is_fisheye;
};

// Twin: texproj/fisheye.py. Of the block k1..k4, p1, p2, s1 and s3 are used.
vec2 fisheye_model(vec2 xy) {
    vec4 a = lens_k1_k2_p1_p2, b = lens_k3_k4_k5_k6, s = lens_s1_s2_s3_s4;
    float r = length(xy);
    vec2 u = r > 0.0 ? xy * (atan(r) / r) : xy;
    float t2 = dot(u, u);
    float radial = 1.0 + t2 * (a.x + t2 * (a.y + t2 * (b.x + t2 * b.y)));
    float cross2 = 2.0 * u.x * u.y;
    vec2 tangential = vec2(a.z * cross2 + a.w * (t2 + 2.0 * u.x * u.x),
                           a.w * cross2 + a.z * (t2 + 2.0 * u.y * u.y));
    return u * radial + tangential + vec2(s.x, s.z) * t2;
}

vec2 lens_model(vec2 xy) {
    if (lens_is_fisheye > 0.5) return fisheye_model(xy);
    vec4 a = lens_k1_k2_p1_p2, b = lens_k3_k4_k5_k6, s = lens_s1_s2_s3_s4;
    float r2 = dot(xy, xy);
    float radial = (1.0 + r2 * (a.x + r2 * (a.y + r2 * b.x)))
                 / (1.0 + r2 * (b.y + r2 * (b.z + r2 * b.w)));
    float cross2 = 2.0 * xy.x * xy.y;
    vec2 tangential = vec2(a.z * cross2 + a.w * (r2 + 2.0 * xy.x * xy.x),
                           a.z * (r2 + 2.0 * xy.y * xy.y) + a.w * cross2);
    vec2 prism = vec2(s.x * r2 + s.y * r2 * r2, s.z * r2 + s.w * r2 * r2);
    vec3 tilted = mat3(lens_tilt) * vec3(xy * radial + tangential + prism, 1.0);
    return tilted.xy / tilted.z;
}

// Camera axes to camera axes: the point on the distorted ray, at the same depth.
vec3 distorted(vec3 xyz_in_cam) {
    vec2 xy = xyz_in_cam.xy;
    float size = length(xy);
    if (size < lens_limit * xyz_in_cam.z) {
        xy = lens_model(xy / xyz_in_cam.z) * xyz_in_cam.z;
    } else if (size > 0.0) {
        xy = lens_model(xy / size * lens_limit) * size / lens_limit;
    }
    return vec3(xy, xyz_in_cam.z);
}
