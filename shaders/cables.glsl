// float cable_coverage(vec2 pixel): share of a pixel that the hoisting cables cover, 0..1.
// pixel: Position of its centre. The share is computed analytically, because point samples would draw
// a cable thinner than their spacing as dashes.

#include "cables.constants"
#include "samples.constants"
#include "view.block"
#include "view_ray.glsl"

// Integral of the pixel filter up to x pixels from its centre: a tent for 2 samples per axis, else
// a box, as in SampleLattice.filter.
float filtered_below(float x) {
#if SAMPLES_PER_AXIS == 2
    float t = clamp(x, -1.0, 1.0);
    return fma(-0.5 * t, abs(t), 0.5 + t);
#else
    return clamp(0.5 + x, 0.0, 1.0);
#endif
}

// Z component of the cross product.
float turned(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }

// All cables are vertical.
float cable_coverage(vec2 pixel) {
    vec3 ray = view_ray(pixel);
    // Half the width at which an axis-aligned square bar is seen. Like `aside`, it is multiplied by
    // the horizontal length of the ray.
    float half_width = CABLE_HALF_SIDE_M * (abs(ray.x) + abs(ray.y));
    vec2 rise = ray.xy * (ray.z / max(dot(ray.xy, ray.xy), 1e-9));   // Climb per horizontal metre.
    float cover = 0.0;
    vec2 last = vec2(1.0, 0.0);   // Strip of the previous cable; empty at first.
    int i = 0;
    do {
        vec3 foot = cable_lower_end[i].xyz;
        float pixels = cable_lower_end[i].w;
        float aside = turned(foot.xy, ray.xy);
        float height = dot(foot.xy, rise) - foot.z;
        bool there = dot(foot.xy, ray.xy) > 0.0 && height > 0.0 && height < CABLE_LENGTH_M;
        vec2 strip = vec2(filtered_below((aside - half_width) * pixels),
                          filtered_below((aside + half_width) * pixels));
        bool met = there && strip.y > strip.x;
        // Count the overlap with the previous cable once.
        float both = max(min(strip.y, last.y) - max(strip.x, last.x), 0.0);
        cover += met ? strip.y - strip.x - both : 0.0;
        last = met ? strip : last;
    } while (++i < CABLES);
    return min(cover, 1.0);
}
