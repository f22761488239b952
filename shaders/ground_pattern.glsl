// Filtered patterns of the ground in the plane; all lengths in mm.
// struct GroundFootprint: the ellipse on the ground that a pixel sees.
// float width_along(GroundFootprint f, vec2 axis): its width along a unit vector.
// float band_cover(float x, float half_width, float filter_width): share of a filter on a band about 0.
// float bands_cover(float x, float spacing, float width, float filter_width): the same for bands about
// all multiples of `spacing`.

struct GroundFootprint {
    vec2 along;      // Unit vector along its longer axis.
    float least;     // Its width.
    float stretch;   // Its length over its width, squared, less 1.
    float noise;     // Width for lookups of noise.
};

float width_along(GroundFootprint f, vec2 axis) {
    float aligned = dot(axis, f.along);
    return f.least * sqrt(fma(aligned * aligned, f.stretch, 1.0));
}

float band_cover(float x, float half_width, float filter_width) {
    float low = max(x - 0.5 * filter_width, -half_width);
    float high = min(x + 0.5 * filter_width, half_width);
    return max(high - low, 0.0) / filter_width;
}

// The integral of the bands from 0 to x; bands start at multiples of the spacing.
float bands_integral(float x, float spacing, float width) {
    float whole = floor(x / spacing);
    return fma(whole, width, min(fma(-whole, spacing, x), width));
}

float bands_cover(float x, float spacing, float width, float filter_width) {
    x += 0.5 * width;
    float high = bands_integral(x + 0.5 * filter_width, spacing, width);
    return (high - bands_integral(x - 0.5 * filter_width, spacing, width)) / filter_width;
}
