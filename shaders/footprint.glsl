// Coverage of a pixel by decals and letters, for a pixel that is a parallelogram on the sheet.
// Footprint footprint_of(mat2 pixel_mm, vec3 fold): pixel_mm holds the sheet distances of one pixel to the
// right and one pixel down, in mm. fold: See Footprint.
// float seen_share(Footprint pixel, vec2 normal): how much larger a part of the sheet looks than it would
// with the sheet's mean slope. normal: Mean normal of the part, out of the face and along the corrugation.
// float covered_box(vec2 p, vec2 half_mm, vec2 width_mm): share of a box of width_mm around p that lies
// in a box of half_mm around the origin.
// vec2 box_widths(Footprint pixel, mat2 axes): width along each axis of a box like the pixel. axes: Unit
// vectors on the sheet.
// vec2 pixel_box(mat2 to_px, vec2 half_mm): half sides in pixels of a box that is parallel to the pixels and
// has the area of a rectangle of half_mm.
// float covered_pixel(vec2 center_px, vec2 half_px): share of the unit pixel at center_px that lies in a
// box around the origin. Its sum over all pixels is the box's area, wherever the box lies.

struct Footprint {
    mat2 pixel_mm;
    mat2 to_px;      // Inverse of pixel_mm.
    float mean_mm;   // Side of a square of the pixel's area.
    vec3 fold;       // Factors that turn a normal into seen_share; how far pixel_mm is that of the mean
                     // slope instead of the local one, 0..1.
};

Footprint footprint_of(mat2 pixel_mm, vec3 fold) {
    return Footprint(pixel_mm, inverse(pixel_mm), sqrt(abs(determinant(pixel_mm))), fold);
}

float seen_share(Footprint pixel, vec2 normal) {
    return mix(1.0, max(dot(pixel.fold.xy, normal), 0.0), pixel.fold.z);
}

float covered_box(vec2 p, vec2 half_mm, vec2 width_mm) {
    vec2 low = max(p - 0.5 * width_mm, -half_mm), high = min(p + 0.5 * width_mm, half_mm);
    vec2 part = max(high - low, 0.0) / width_mm;
    return part.x * part.y;
}

vec2 box_widths(Footprint pixel, mat2 axes) {
    vec2 right = pixel.pixel_mm[0] * axes, down = pixel.pixel_mm[1] * axes;
    return sqrt(right * right + down * down);
}

vec2 pixel_box(mat2 to_px, vec2 half_mm) {
    mat2 sides = mat2(to_px[0] * half_mm.x, to_px[1] * half_mm.y);
    vec2 half_px = sqrt(sides[0] * sides[0] + sides[1] * sides[1]);
    return half_px * sqrt(abs(determinant(sides)) / (half_px.x * half_px.y));
}

float covered_pixel(vec2 center_px, vec2 half_px) { return covered_box(center_px, half_px, vec2(1.0)); }
