// Nothing casts a shadow. Panels that face away from a light stay dark.

#include "variant.constants"
#include "view.block"

vec4 light_visibility(vec3 outward, vec3 from_eye, vec3 normal, float footprint_m) {
    vec4 seen = vec4(0.0);
    for (int i = 0; i < LIGHTS; ++i)
        if (i < light_count && dot(outward, light_direction[i].xyz) >= 0.0) seen[i] = 1.0;
    return seen;
}
