// vec3 occluder_light(vec3 outward, vec3 from_eye, vec3 normal, SkyVisibility sky): irradiance / pi of the
// directional lights on the occluders of a point, times the share of the hemisphere that they hide.
// outward: Outward axis of the panel's face, or 0. from_eye: Vector from the eye to the point in m.
// The occluder is modelled as a wall at right angles to the surface. It faces the direction of the bent
// normal along the surface, or stands all around if there is none. It is lit if the light reaches a
// place near the point. A low light shines on sides of an overhead spreader that the surface does not
// see: the factor `seen` is fitted to rays below spreaders.

#include "units.constants"
#include "variant.constants"
#include "view.block"
#include "bent_normal_tangent.glsl"
#include "shadow_map.glsl"

// The share of light i.
vec3 occluder_light_of(vec3 from_eye, vec3 normal, SkyVisibility sky, int i) {
    vec3 toward = light_direction[i].xyz;
    vec3 aside = bent_normal_tangent(sky, normal);
    float most = length(aside);
    // Mean cosine of the light on walls all around.
    float walled = length(toward - normal * dot(normal, toward)) / PI;
    float facing = mix(walled, max(dot(aside, toward), 0.0) / max(most, 1e-3),
                       smoothstep(0.0, 0.1, most));
    float lit = shadow_map_at(from_eye + 0.02 * sky.bent_normal, i);
    float seen = mix(1.0, clamp(3.0 * dot(normal, toward), 0.0, 1.0), sky.overhead);
    return sky.cone_cosine * sky.cone_cosine * facing * lit * seen * light_irradiance[i].rgb;
}

vec3 occluder_light(vec3 outward, vec3 from_eye, vec3 normal, SkyVisibility sky) {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < LIGHTS; ++i)
        if (i < light_count && dot(outward, light_direction[i].xyz) >= 0.0)
            sum += sky.lacks_indirect * occluder_light_of(from_eye, normal, sky, i);
    return sum;
}
