// vec3 display_color(vec3 color): tone-mapped and encoded colour of exposed radiance, or the encoded value
// of a single-layer image. Normals and radiance images stay as they are.

#include "variant.constants"
#include "tone_curve.glsl"

// Must run after the pixel filter, because a pixel averages light, not encoded values.
vec3 display_color(vec3 color) {
#if RADIANCE || LAYER == LAYER_NORMALS
    return color;
#elif LAYER == LAYER_ALL
    color = neutral_tone(color);
#endif
    return srgb_encode(color);
}
