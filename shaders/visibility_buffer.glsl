// The visibility buffer, which geometry.frag writes: one texel per sample. The shading stages read it.
// uint surface_id_at(ivec2 middle): surface id of one sample in the visibility buffer; 0 is sky.
// uint[] near_surface_ids(ivec2 middle): ids of the first FILTER_NEAR samples of the pixel filter.
// uint[] filter_surface_ids(ivec2 middle): ids of all its samples, in the order of FILTER_OFFSET.
// middle: Texel of the sample at the pixel's centre.

#include "samples.constants"

uniform usampler2D surface_ids;            // 0 where no surface is seen.
uniform sampler2D atlas_positions;         // In mm.
uniform sampler2D surface_depths;          // In m.
uniform usampler2D sky_visibility_cones;   // Four bytes per texel.
uniform usampler2D sky_visibility_light;   // Four bytes per texel.

uint surface_id_at(ivec2 middle) { return texelFetch(surface_ids, middle, 0).r; }

#if SAMPLES_PER_AXIS == 2 || SAMPLES_PER_AXIS == 3
// Near samples are at most a texel from the centre. Two gathers return most ids at half the cost
// of single fetches.
uint[FILTER_NEAR] near_surface_ids(ivec2 middle) {
    vec2 corner = 1.0 / vec2(textureSize(surface_ids, 0));
    uvec4 low = textureGather(surface_ids, vec2(middle) * corner);
    uvec4 high = textureGather(surface_ids, vec2(middle + 1) * corner);
    uint beside[9] = uint[9](
        low.w, low.z, surface_id_at(middle + ivec2(1, -1)),
        low.x, low.y, high.z,
        surface_id_at(middle + ivec2(-1, 1)), high.x, high.y);
    uint sample_ids[FILTER_NEAR];
    for (int i = 0; i < FILTER_NEAR; ++i)
        sample_ids[i] = beside[3 * (FILTER_OFFSET[i].y + 1) + FILTER_OFFSET[i].x + 1];
    return sample_ids;
}
#else
uint[FILTER_NEAR] near_surface_ids(ivec2 middle) {
    uint sample_ids[FILTER_NEAR];
    for (int i = 0; i < FILTER_NEAR; ++i) sample_ids[i] = surface_id_at(middle + FILTER_OFFSET[i]);
    return sample_ids;
}
#endif

uint[FILTER_SAMPLES] filter_surface_ids(ivec2 middle) {
    uint near[FILTER_NEAR] = near_surface_ids(middle);
    uint sample_ids[FILTER_SAMPLES];
    for (int i = 0; i < FILTER_NEAR; ++i) sample_ids[i] = near[i];
    for (int i = FILTER_NEAR; i < FILTER_SAMPLES; ++i) sample_ids[i] = surface_id_at(middle + FILTER_OFFSET[i]);
    return sample_ids;
}
