// uint key_at(ivec2 middle), uint[] keys_around(ivec2 middle): the surfaces that a pixel's samples see.

uniform usampler2D surface_keys;

uint key_at(ivec2 middle) { return texelFetch(surface_keys, middle, 0).r; }

#if SAMPLES_PER_AXIS > 1
// of the 3 x 3 samples up to a texel away; two gathers bring most at half the cost of fetches
uint[9] keys_beside(ivec2 middle) {
    vec2 corner = 1.0 / vec2(textureSize(surface_keys, 0));
    uvec4 low = textureGather(surface_keys, vec2(middle) * corner);
    uvec4 high = textureGather(surface_keys, vec2(middle + 1) * corner);
    return uint[9](
        low.w, low.z, key_at(middle + ivec2(1, -1)),
        low.x, low.y, high.z,
        key_at(middle + ivec2(-1, 1)), high.x, high.y);
}

// in the order of FILTER_OFFSET
uint[FILTER_SAMPLES] keys_around(ivec2 middle) {
    uint beside[9] = keys_beside(middle);
    uint keys[FILTER_SAMPLES];
    for (int i = 0; i < FILTER_SAMPLES; ++i)
        keys[i] = abs(FILTER_OFFSET[i].x) > 1 ? key_at(middle + FILTER_OFFSET[i])
                                            : beside[3 * (FILTER_OFFSET[i].y + 1) + FILTER_OFFSET[i].x + 1];
    return keys;
}

// the first of them, those that count for most
uint[FILTER_NEAR] keys_near(ivec2 middle) {
    uint beside[9] = keys_beside(middle);
    uint keys[FILTER_NEAR];
    for (int i = 0; i < FILTER_NEAR; ++i)
        keys[i] = beside[3 * (FILTER_OFFSET[i].y + 1) + FILTER_OFFSET[i].x + 1];
    return keys;
}
#else
uint[FILTER_SAMPLES] keys_around(ivec2 middle) { return uint[FILTER_SAMPLES](key_at(middle)); }
uint[FILTER_NEAR] keys_near(ivec2 middle) { return keys_around(middle); }
#endif
