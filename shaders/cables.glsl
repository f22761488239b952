// float cables_cover(vec2 pixel): the share of a pixel that cables cover, from where they run: samples
// hit what is thinner than their distance now and then, and a straight cable would come out in dashes.

// the pixel filter's integral up to x pixels beside its centre
float filtered_below(float x) {
#if SAMPLES_PER_AXIS == 2
    float t = clamp(x, -1.0, 1.0);
    return fma(-0.5 * t, abs(t), 0.5 + t);
#else
    return clamp(0.5 + x, 0.0, 1.0);
#endif
}

float turned(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }

// cables are upright; pixel: its centre
float cables_cover(vec2 pixel) {
    vec3 ray = view_ray(pixel);
    // of four sides along the axes; this and the distances below times the ray's level length
    float half_width = CABLE_HALF_SIDE_M * (abs(ray.x) + abs(ray.y));
    float cover = 0.0;
    vec2 last = vec2(1.0, 0.0);   // from where to where the cable before covers; nothing yet
    int i = 0;
    do {
        vec4 foot = cable_foot[i];
        float aside = turned(foot.xy, ray.xy);
        // by how much a pixel to the right or down moves it; what a lens magnifies is left out
        vec2 slope = vec2(turned(foot.xy, ray_right.xy), turned(foot.xy, ray_down.xy));
        float pixels = inversesqrt(max(dot(slope, slope), 1e-18));
        float depth = dot(foot.xy, ray.xy) / max(dot(ray.xy, ray.xy), 1e-9);
        float height = depth * ray.z - foot.z;
        bool there = depth > 0.0 && height > 0.0 && height < foot.w;
        vec2 strip = vec2(filtered_below((aside - half_width) * pixels),
                          filtered_below((aside + half_width) * pixels));
        bool met = there && strip.y > strip.x;
        // side by side in the image two cover more than one behind the other
        float both = max(min(strip.y, last.y) - max(strip.x, last.x), 0.0);
        cover += met ? strip.y - strip.x - both : 0.0;
        last = met ? strip : last;
    } while (++i < CABLES);
    return min(cover, 1.0);
}
