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
    // of four sides along the axes; this and what lies aside are times the ray's level length
    float half_width = CABLE_HALF_SIDE_M * (abs(ray.x) + abs(ray.y));
    vec2 rise = ray.xy * (ray.z / max(dot(ray.xy, ray.xy), 1e-9));   // for a metre of what is level
    float cover = 0.0;
    vec2 last = vec2(1.0, 0.0);   // from where to where the cable before covers; nothing yet
    int i = 0;
    do {
        vec3 foot = cable_foot[i].xyz;
        float pixels = cable_foot[i].w;
        float aside = turned(foot.xy, ray.xy);
        float height = dot(foot.xy, rise) - foot.z;
        bool there = dot(foot.xy, ray.xy) > 0.0 && height > 0.0 && height < CABLE_LENGTH_M;
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
