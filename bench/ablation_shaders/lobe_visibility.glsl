// Nothing hides the sky from reflected lobes.

#include "sky_visibility.glsl"

float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness) { return 1.0; }
