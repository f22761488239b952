// Occluders reflect no directional light.

#include "sky_visibility.glsl"

vec3 occluder_light(vec3 outward, vec3 from_eye, vec3 normal, SkyVisibility sky) { return vec3(0.0); }
