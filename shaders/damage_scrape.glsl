// DamageMark scrape_mark(int i, vec3 q): scratches at local coordinates q.
// Twin of fastgen/damages/scrape.py.

#include "damage.block"
#include "cell_noise.glsl"
#include "damage_field.glsl"

bool scraped(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];       // Pitch, density, contact, raggedness.
    vec4 b = damage_shape[3 * i + 1];   // Phase, waviness.
    float ragged = 0.5 + 0.3 * sin(q.y / (3.1 * a.x) + b.x) + 0.2 * sin(q.y / a.x - b.x);
    float outside = max(abs(q.y) - damage_across[i].w, abs(q.x) - damage_along[i].w + a.w * ragged);
    return outside < 0.0 && in_contact(q.z, a.z);
}

// Mean wear of many scratches of a layer, as a factor of their density.
const float SCRATCH_MEAN = 0.16;

// Two layers of scratches that spread like a fan. Each cell across them, a.x mm high in the middle of
// the first layer, has at most one. Neighbours resemble each other in length and place, as if one
// object had made them. Scratches end within the scrape.
float scrape_wear(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];
    vec4 b = damage_shape[3 * i + 1];
    float half_length = damage_along[i].w;
    float wave = b.y * sin(q.x / 170.0 + b.x);
    float fan = 1.0 + 0.3 * sin(7.0 * b.x) * q.x / half_length;
    float wear = 0.0;
    for (int layer = 0; layer < 2; ++layer) {
        float scale = fan / a.x * (layer == 0 ? 1.0 : 0.37);
        float across = (q.y + wave * float(1 - layer)) * scale, filter_width = mark_filter_mm * scale;
        float cell = floor(across);
        // Each scrape and layer has random numbers of its own, from a whole number.
        float own = 4.0 * floor(1000.0 * b.x) + 2.0 * float(layer);
        vec4 draw = cell_noise(vec2(cell, own)), group = cell_noise(vec2(floor(cell / 5.0), own + 1.0));
        float reach = half_length * mix(0.2, 1.0, sqrt(group.x) * mix(0.4, 1.0, draw.z));
        float middle = (half_length - reach) * clamp(2.0 * group.y - 1.0 + 0.6 * (draw.y - 0.5), -1.0, 1.0);
        float along = clamp(3.0 - 3.0 * abs(q.x - middle) / reach, 0.0, 1.0);
        float thickness = mix(0.15, 0.5, draw.w * along);
        // A band with soft edges, filtered by a box. Wide boxes see many scratches.
        float width = max(filter_width, 0.5 * thickness), from_middle = across - cell - 0.5;
        float low = max(from_middle - 0.5 * width, -0.75 * thickness);
        float profile = max(min(from_middle + 0.5 * width, 0.75 * thickness) - low, 0.0) / width;
        float depth = draw.x < a.y * mix(0.6, 1.4, group.z) ? mix(0.5, 1.0, draw.w) : 0.0;
        float one = along * profile * depth, many = SCRATCH_MEAN * a.y;
        wear += (1.0 - wear) * mix(one, many, smoothstep(0.6, 1.8, filter_width));
    }
    return wear;
}

DamageMark scrape_mark(int i, vec3 q) {
    return DamageMark(scraped(i, q), scrape_wear(i, q), damage_fresh(i), damage_bare[i].rgb, false);
}
