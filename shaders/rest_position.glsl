// vec3 rest_at(ivec2 sample_at): position of a sample's surface point before any damage, in mm.

uniform sampler2D rest_x;
uniform sampler2D rest_y;
uniform sampler2D rest_z;

vec3 rest_at(ivec2 sample_at) {
    return vec3(texelFetch(rest_x, sample_at, 0).r, texelFetch(rest_y, sample_at, 0).r,
                texelFetch(rest_z, sample_at, 0).r);
}
