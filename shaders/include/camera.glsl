// The pinhole camera of a pass, from render/context.py::camera_block.
// cam_from_local: scene coordinates (world minus the scene offset) to camera axes, mesh units.
// clip_from_cam: row r of the target is image row r, so the y axis needs no flip anywhere.
layout(std140) uniform Camera {
    mat4 cam_from_local;
    mat4 clip_from_cam;
};
