// DecalHit decals_at(uint zone, vec2 atlas_mm, float footprint_mm, NoiseSample coarse, NoiseSample streaks):
// decals at a point of the atlas. footprint_mm: width of the lookup on the surface.

#include "decals.constants"
#include "tone_curve.glsl"
#include "worn_art.glsl"

uniform sampler2D decal_table;      // One row per decal; see DecalTables in decal_tables.py.
uniform sampler2D glyph_table;      // One texel per letter; see GlyphRun in glyph_runs.py.
uniform sampler2DArray art;         // Markers, stickers, emblems: sRGB, straight alpha.
uniform sampler2DArray glyph_tiles; // R: signed distance, 0.5 on the outline. G: ink coverage.

struct DecalHit {
    vec3 ink;      // Albedo of the decals times `alpha`.
    float alpha;   // Covered share of the footprint, 0..1.
    uint id;       // Object at the exact point, 0 for none.
    float patched;   // Share of the footprint under paint or tape of a repair, 0..1.
};
const DecalHit NO_DECAL = DecalHit(vec3(0.0), 0.0, 0u, 0.0);

vec4 decal_texel(uint decal, int column) {
    return texelFetch(decal_table, ivec2(column, int(decal) - 1), 0);
}

// Distance in mm to the nearest side of a box, positive inside.
float inside_box(vec2 p, vec2 half_size) {
    vec2 d = half_size - abs(p);
    return min(d.x, d.y);
}

// Distance in mm to the nearest side of the triangle on the lower side of a box, positive inside.
float inside_triangle(vec2 p, vec2 half_size) {
    vec2 side = vec2(2.0 * half_size.y, half_size.x);   // Normal of the right side.
    return min(half_size.y + p.y, dot(side, vec2(-abs(p.x), half_size.y - p.y)) / length(side));
}

// Ink coverage of one glyph at d mm from its centre. The distance field gives sharp outlines nearby
// (Green 2007, Improved Alpha-Tested Magnification for Vector Textures and Special Effects). Averaged
// distances lose or gain ink once the footprint nears the width of a stroke, so mip-mapped coverage
// takes over there.
float glyph_ink(vec2 d, float layer, float cap_mm, float footprint_mm) {
    float tile_mm = GLYPH_TILE_CAPS * cap_mm;
    vec2 uv = d / tile_mm + 0.5;
    if (any(lessThan(uv, vec2(0.0))) || any(greaterThan(uv, vec2(1.0)))) return 0.0;
    float lod = log2(footprint_mm * GLYPH_TILE_SIZE / tile_mm);
    // Half a level finer, because bilinear filtering widens a texel by about half.
    vec2 texel = textureLod(glyph_tiles, vec3(uv.x, 1.0 - uv.y, layer), max(lod - 0.5, 0.0)).rg;
    float distance_mm = (texel.r - 0.5) * GLYPH_RANGE_CAPS * cap_mm;
    float sharp = clamp(0.5 + distance_mm / footprint_mm, 0.0, 1.0);
    return mix(sharp, texel.g, smoothstep(0.25, 1.25, lod));
}

vec4 glyph_texel(uint glyph) { return texelFetch(glyph_table, ivec2(glyph & 255u, glyph >> 8), 0); }

// Ink coverage of a text at p mm from its middle. run: the fifth texel of the decal's row.
float text_coverage(vec2 p, vec4 run, float footprint_mm) {
    float cap_mm = run.x;
    uint start = uint(run.y);
    float along = run.w < 0.0 ? p.y : p.x;
    float part = clamp(fma(along, abs(run.w), 0.5 * run.z), 0.0, run.z - 1.0);
    uint reach = uint(glyph_texel(start + uint(part)).w);
    uint g = start + reach / GLYPH_RANGE, end = start + reach % GLYPH_RANGE;
    // Offset, layer and distance of the two nearest glyphs: a wide footprint may touch both.
    vec4 first = vec4(1e9, 1e9, 0.0, 1e9);
    vec4 second = first;
    do {
        vec4 glyph = glyph_texel(g);
        vec2 d = p - glyph.xy;
        vec4 found = vec4(d, glyph.z, g < end ? max(abs(d.x), abs(d.y)) : 1e9);
        if (found.w < first.w) { second = first; first = found; }
        else if (found.w < second.w) second = found;
    } while (++g < end);
    return min(glyph_ink(first.xy, first.z, cap_mm, footprint_mm) +
               glyph_ink(second.xy, second.z, cap_mm, footprint_mm), 1.0);
}

// Distance in mm to the ragged line along which corners were torn off, positive on the decal.
// torn: Shares of the half width and half height that are missing at left, right, top and bottom.
float inside_tear(vec2 p, vec2 half_size, vec4 torn, NoiseSample coarse) {
    vec4 to_line = (1.0 - torn) * half_size.xxyy + vec4(p.x, -p.x, -p.y, p.y);
    to_line = mix(vec4(1e6), to_line, greaterThan(torn, vec4(0.0)));
    return min(min(to_line.x, to_line.y), min(to_line.z, to_line.w)) +
           (coarse.value.w - 0.5) * 0.12 * half_size.x;
}

// Adds one decal on top of `hit`.
void add_decal(inout DecalHit hit, uint decal, vec2 atlas_mm, float footprint_mm, NoiseSample coarse,
               NoiseSample streaks) {
    vec4 place = decal_texel(decal, 1);
    vec4 turn = decal_texel(decal, 0);
    vec2 d = atlas_mm - place.xy;
    vec2 p = vec2(dot(turn.xy, d), dot(turn.zw, d));
    vec4 kind = decal_texel(decal, 3);
    float inside_mm = kind.x == DECAL_MARKER
        ? (place.z - abs(p.x) - abs(p.y)) * 0.70710678
        : kind.x == DECAL_TRIANGLE ? inside_triangle(p, place.zw) : inside_box(p, place.zw);
    if (inside_mm < -footprint_mm) return;
    vec4 ink = decal_texel(decal, 2);
    float alpha = clamp(0.5 + inside_mm / footprint_mm, 0.0, 1.0);
    vec3 albedo = ink.rgb;
    vec2 uv = p / (2.0 * place.zw) + 0.5;
    if (kind.x == DECAL_TEXT) {
        alpha *= text_coverage(p, decal_texel(decal, 4), footprint_mm);
    } else if (kind.x == DECAL_STRIPES) {
        float period_mm = 4.0 * place.w;
        float wave = abs(fract((p.x + p.y) / period_mm) - 0.5) * period_mm - 0.25 * period_mm;
        albedo = mix(vec3(0.012), ink.rgb, clamp(0.5 + wave / footprint_mm, 0.0, 1.0));
    } else if (kind.x != DECAL_PATCH) {
        // Half a level finer, because trilinear filtering widens the footprint by about as much.
        float lod = max(log2(footprint_mm * ART_SIZE / (2.0 * place.z)) - 0.5, 0.0);
        vec4 texel = textureLod(art, vec3(uv.x, 1.0 - uv.y, kind.z), lod);
        if (kind.x == DECAL_STICKER || kind.x == DECAL_EMBLEM) alpha *= texel.a;
        if (kind.x != DECAL_EMBLEM) {
            float tear_mm = inside_tear(p, place.zw, decal_texel(decal, 4), coarse);
            vec4 aged = worn_art(srgb_decode(texel.rgb), ink.rgb, ink.a, kind.w, coarse, streaks);
            alpha *= aged.a * clamp(0.5 + tear_mm / footprint_mm, 0.0, 1.0);
            albedo = aged.rgb;
        }
    }
    // Painted decals wear off in flakes.
    if (kind.x != DECAL_MARKER && kind.x != DECAL_STICKER && kind.x != DECAL_TRIANGLE)
        alpha *= 1.0 - ink.a * covered(coarse.value.w, 0.6, coarse.lost.w, 0.15);
    hit.ink = mix(hit.ink, albedo, alpha);
    hit.alpha += alpha * (1.0 - hit.alpha);
    if (kind.x == DECAL_PATCH) hit.patched += alpha * (1.0 - hit.patched);
    if (inside_mm >= 0.0 && kind.y > 0.0) hit.id = uint(kind.y);
}

DecalHit decals_at(uint zone, vec2 atlas_mm, float footprint_mm, NoiseSample coarse, NoiseSample streaks) {
    DecalHit hit = NO_DECAL;
    uvec4 cell = cell_at(zone, atlas_mm);
    int i = 0;
    uint decal = cell.x & 0xffffu;
    do {
        if (decal != 0u) add_decal(hit, decal, atlas_mm, footprint_mm, coarse, streaks);
        ++i;
        uint pair = cell[(i & 7) >> 1];
        decal = (i & 1) == 0 ? pair & 0xffffu : pair >> 16;
    } while (i < 8 && decal != 0u);
    return hit;
}
