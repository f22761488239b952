// uint pack_surface_id(uint zone, vec3 normal): surface id of a zone and a unit normal of it.
// uint id_zone(uint id), vec3 id_normal(uint id): zone and normal of a surface id other than 0.

#include "octahedral.glsl"

// Zone + 1 is in the low 10 bits, so that 0 means no surface. The normal takes 2 x 11 bits.
uint pack_surface_id(uint zone, vec3 normal) {
    // An even number of steps represents the axes exactly.
    uvec2 n = uvec2(octahedral(normal) * 2046.0 + 0.5);
    return (zone + 1u) | (n.x << 10) | (n.y << 21);
}

uint id_zone(uint id) { return (id & 1023u) - 1u; }

vec3 id_normal(uint id) {
    return octahedral_direction(vec2((id >> 10) & 2047u, id >> 21) / 2046.0);
}
