// Shaded shade_sky(vec3 ray): the background along a view ray.

#include "units.constants"
#include "variant.constants"
#include "view.block"
#include "environment_map.glsl"
#include "shaded.glsl"

Shaded shade_sky(vec3 ray) {
#if LAYER == LAYER_ALL
    vec3 color = exposure * background(ray);
#elif LAYER == LAYER_NORMALS
    vec3 color = vec3(0.5);   // The sky has no normal.
#else
    vec3 color = vec3(1.0);
#endif
    return Shaded(color, 0u, 0u, NO_DEPTH, 0.0);
}
