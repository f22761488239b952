// Vertex stage: rectangles of the image at the depth of the sky. Reads their corners from a texture.
#version 430 core
#include "ground.constants"
#include "units.constants"

uniform isampler2D rectangles;   // Of each in pixels: first column and row, and those after the last.
uniform int first_rectangle;
uniform vec2 target_size;        // Width and height in pixels.

void main() {
    ivec4 ends = texelFetch(rectangles, ivec2(first_rectangle + gl_VertexID / 6, 0), 0);
    const int corners[6] = int[6](0, 1, 2, 2, 1, 3);
    int corner = corners[gl_VertexID % 6];
    bvec2 last = bvec2((corner & 1) != 0, (corner & 2) != 0);
#if GROUND_COARSE
    // One texel more, because spreading interpolates.
    ends = ivec4(ends.xy / 2 - 1, (ends.zw + 1) / 2 + 1);
#endif
    vec2 pixel = mix(vec2(ends.xy), vec2(ends.zw), last);
    gl_Position = vec4(pixel / target_size * 2.0 - 1.0, SKY_DEPTH, 1.0);
}
