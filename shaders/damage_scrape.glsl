// DamageMark scrape_mark(int i, vec3 q): scratches at local coordinates q.
// Twin of fastgen/damages/scrape.py.

#include "damage.block"
#include "damage_field.glsl"

bool scraped(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];       // Pitch, density, contact, raggedness.
    vec4 b = damage_shape[3 * i + 1];   // Phase, waviness.
    float ragged = 0.5 + 0.3 * sin(q.y / (3.1 * a.x) + b.x) + 0.2 * sin(q.y / a.x - b.x);
    float outside = max(abs(q.y) - damage_across[i].w, abs(q.x) - damage_along[i].w + a.w * ragged);
    return outside < 0.0 && in_contact(q.z, a.z);
}

// Two layers of scratches. Each cell of height `pitch` across has one, of its own length and depth.
float scrape_wear(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];
    vec4 b = damage_shape[3 * i + 1];
    float half_length = damage_along[i].w;
    float wave = b.y * sin(q.x / 170.0 + b.x);
    float wear = 0.0;
    for (int layer = 0; layer < 2; ++layer) {
        float across = (q.y + wave * float(1 - layer)) / a.x * (layer == 0 ? 1.0 : 0.37);
        float cell = floor(across);
        // A phase of its own turns each scratch's number into other random numbers.
        vec4 draw = fract(sin(vec4(12.9898, 78.233, 37.719, 93.989) * (cell + 0.7 * b.x + float(layer))) *
                          4375.8547);
        float middle = half_length * (1.6 * draw.y - 0.8);
        float reach = half_length * mix(0.25, 1.1, draw.z);
        float along = clamp(4.0 - 4.0 * abs(q.x - middle) / reach, 0.0, 1.0);
        float profile = clamp(2.0 - 4.0 * abs(across - cell - 0.5), 0.0, 1.0);
        float depth = draw.x < a.y ? mix(0.4, 1.0, draw.w) : 0.0;
        wear = max(wear, along * profile * depth);
    }
    return wear;
}

DamageMark scrape_mark(int i, vec3 q) {
    return DamageMark(scraped(i, q), scrape_wear(i, q), damage_fresh(i), damage_bare[i].rgb, false);
}
