// Images that compute shaders write: color_image, label_image, depth_image.
// Targets.bind_images binds them. Shaders that draw over an image also read its colour.

#include "variant.constants"

#if OVER
#define COLOR_ACCESS
#else
#define COLOR_ACCESS writeonly
#endif
#if RADIANCE
layout(rgba32f, binding = 0) COLOR_ACCESS uniform image2D color_image;
#else
layout(r32ui, binding = 0) COLOR_ACCESS uniform uimage2D color_image;   // RGBA8, stored as one number.
#endif
layout(r32ui, binding = 1) writeonly uniform uimage2D label_image;
layout(r32f, binding = 2) writeonly uniform image2D depth_image;
