// ivec2 center_texel(ivec2 pixel): texel of the sample at a pixel's centre, in the visibility buffer.
// vec2 from_center(vec2 offset): offset in pixels of the sample `offset` texels from that sample.
// vec2 sample_position(ivec2 sample_at): position of a sample in the image, in pixels.
// Twin of fastgen/render/sample_lattice.py, which explains the slanted lattice of samples.

#include "samples.constants"

ivec2 center_texel(ivec2 pixel) {
    return pixel * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2 + ivec2(SAMPLE_SLANT * pixel.y + SAMPLE_PAD, 0);
}

vec2 from_center(vec2 offset) {
    float down = offset.y / float(SAMPLES_PER_AXIS);
    return vec2((offset.x - float(SAMPLE_SLANT) * down) / float(SAMPLES_PER_AXIS), down);
}

vec2 sample_position(ivec2 sample_at) {
    return 0.5 + from_center(vec2(sample_at - center_texel(ivec2(0))));
}
