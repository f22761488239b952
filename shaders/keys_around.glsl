// uint key_at(ivec2 middle), uint[] keys_around(ivec2 middle): the surfaces that a pixel's samples see.

uniform usampler2D surface_keys;

uint key_at(ivec2 middle) { return texelFetch(surface_keys, middle, 0).r; }

#if SAMPLES_PER_AXIS > 1
// in the order of TENT_OFFSET; two gathers bring most of the nine at half the cost of fetches
uint[TENT_SAMPLES] keys_around(ivec2 middle) {
    vec2 corner = 1.0 / vec2(textureSize(surface_keys, 0));
    uvec4 low = textureGather(surface_keys, vec2(middle) * corner);
    uvec4 high = textureGather(surface_keys, vec2(middle + 1) * corner);
    uint near[9] = uint[9](
        low.w, low.z, key_at(middle + ivec2(1, -1)),
        low.x, low.y, high.z,
        key_at(middle + ivec2(-1, 1)), high.x, high.y);
    uint keys[TENT_SAMPLES];
    for (int i = 0; i < TENT_SAMPLES; ++i)
        keys[i] = near[3 * (TENT_OFFSET[i].y + 1) + TENT_OFFSET[i].x + 1];
    return keys;
}
#else
uint[TENT_SAMPLES] keys_around(ivec2 middle) { return uint[TENT_SAMPLES](key_at(middle)); }
#endif
