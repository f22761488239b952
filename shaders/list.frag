// Lists the pixels of one class, which the depth test picks.
#version 430 core
#include "blocks.glsl"
#include "pixel_list.glsl"

layout(early_fragment_tests) in;

void main() { list_pixel(ivec2(gl_FragCoord.xy)); }
