// Occluders reflect no light of the sky.

#include "sky_visibility.glsl"

vec3 occluder_indirect(SkyVisibility sky) { return vec3(0.0); }
