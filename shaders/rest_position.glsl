// vec3 rest_at(ivec2 sample_at): position of a sample's surface point before any damage, in mm.

#include "view.block"

uniform sampler2DArray rest_x;
uniform sampler2DArray rest_y;
uniform sampler2DArray rest_z;

vec3 rest_at(ivec2 sample_at) {
    ivec3 at = ivec3(sample_at, samples_layer);
    return vec3(texelFetch(rest_x, at, 0).r, texelFetch(rest_y, at, 0).r, texelFetch(rest_z, at, 0).r);
}
