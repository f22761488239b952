// Where the samples of a pixel lie in the sample targets, and on the image: sample_lattice.py.

// texel of the sample at a pixel's centre
ivec2 middle_of(ivec2 pixel) {
    return pixel * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2 + ivec2(SAMPLE_SLANT * pixel.y + SAMPLE_PAD, 0);
}

// pixels from a pixel's centre to the sample that many texels from it
vec2 from_center(vec2 offset) {
    float down = offset.y / float(SAMPLES_PER_AXIS);
    return vec2((offset.x - float(SAMPLE_SLANT) * down) / float(SAMPLES_PER_AXIS), down);
}

// the place of a sample in the image
vec2 place_of(ivec2 sample_at) { return 0.5 + from_center(vec2(sample_at - middle_of(ivec2(0)))); }
