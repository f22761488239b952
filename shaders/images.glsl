// Images that compute shaders write: color_image, label_image, depth_image.
// Targets.bind_images binds them.

layout(r32ui, binding = 0) writeonly uniform uimage2D color_image;   // RGBA8, stored as one number.
layout(r32ui, binding = 1) writeonly uniform uimage2D label_image;
layout(r32f, binding = 2) writeonly uniform image2D depth_image;
