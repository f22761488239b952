// DecalHit decals_at(int sheet, vec2 atlas_mm, Footprint pixel, NoiseSample coarse, NoiseSample streaks):
// decals at a point of a sheet, averaged over a pixel. sheet: Its number, see sheet_number in zone.glsl.

#include "decals.constants"
#include "scene.block"
#include "footprint.glsl"
#include "text_coverage.glsl"
#include "tone_curve.glsl"
#include "worn_art.glsl"

uniform sampler2D decal_table;      // One row per decal; see DecalTables in decal_tables.py.
uniform sampler2DArray art;         // Markers, stickers, emblems: linear light, premultiplied alpha.

struct DecalHit {
    vec3 ink;      // Albedo of the decals times `alpha`.
    float alpha;   // Covered share of the footprint, 0..1.
    uint id;       // Object at the exact point, 0 for none.
    float patched;   // Share of the footprint under paint or tape of a repair, 0..1.
};
const float DIAGONAL = 0.70710678;
// Side of the decals, in pixels, that are no longer blended toward a box of their area.
const float SHARP_FROM_PX = 4.0;
const DecalHit NO_DECAL = DecalHit(vec3(0.0), 0.0, 0u, 0.0);

vec4 decal_texel(uint decal, int column) {
    return texelFetch(decal_table, ivec2(column, int(decal) - 1), 0);
}

// Distance in mm to the nearest side of the triangle on the lower side of a box, positive inside.
float inside_triangle(vec2 p, vec2 half_mm) {
    vec2 side = vec2(2.0 * half_mm.y, half_mm.x);   // Normal of the right side.
    return min(half_mm.y + p.y, dot(side, vec2(-abs(p.x), half_mm.y - p.y)) / length(side));
}

// Share of the footprint left of a decal whose corners were torn off along a ragged line.
// torn: Shares of the half width and half height that are missing at left, right, top and bottom. small:
// How far the whole decal counts instead of the point p, 0..1.
float left_after_tear(vec2 p, vec2 half_size, vec4 torn, bool diamond, float small, float footprint_mm,
                      NoiseSample coarse) {
    vec4 to_line = (1.0 - torn) * half_size.xxyy + vec4(p.x, -p.x, -p.y, p.y);
    to_line = mix(vec4(1e6), to_line, greaterThan(torn, vec4(0.0)));
    float inside_mm = min(min(to_line.x, to_line.y), min(to_line.z, to_line.w)) +
                      (coarse.value.w - 0.5) * 0.12 * half_size.x;
    vec4 lost = max(torn - (coarse.value.w - 0.5) * 0.12, 0.0) * step(1e-6, torn);
    vec2 rest = 1.0 - 0.5 * (lost.xz + lost.yw);
    float whole = diamond ? 1.0 - 0.5 * dot(lost, lost) : rest.x * rest.y;
    return mix(clamp(0.5 + inside_mm / footprint_mm, 0.0, 1.0), whole, small);
}

// Adds one decal on top of `hit`. A decal ends at its sheet, also where its rectangle reaches farther.
void add_decal(inout DecalHit hit, uint decal, int sheet, vec2 atlas_mm, Footprint pixel, NoiseSample coarse,
               NoiseSample streaks) {
    vec4 about = decal_texel(decal, 3);
    int kind = int(about.x) % DECAL_SHEET;
    if (int(about.x) / DECAL_SHEET != sheet) return;
    vec4 place = decal_texel(decal, 1);
    vec4 turn = decal_texel(decal, 0);
    mat2 axes = mat2(turn.x, turn.y, -turn.y, turn.x);   // Right and up of the decal.
    vec2 d = atlas_mm - place.xy;
    vec2 p = d * axes;
    vec2 width_mm = box_widths(pixel, axes);
    mat2 to_px = pixel.to_px * axes;
    // A decal of about a pixel becomes a box that is parallel to the pixels.
    float small = 1.0 - smoothstep(1.0, SHARP_FROM_PX, 2.0 * sqrt(place.z * place.w) / pixel.mean_mm);
    float rectangle = mix(covered_box(p, place.zw, width_mm),
                          covered_pixel(to_px * p, pixel_box(to_px, place.zw)), small);
    float alpha = rectangle;
    bool diamond = kind == DECAL_MARKER, triangle = kind == DECAL_TRIANGLE;
    vec2 inside = place.zw - abs(p);
    float inside_mm = min(inside.x, inside.y);
    if (diamond) {
        const mat2 diagonal = mat2(DIAGONAL, DIAGONAL, -DIAGONAL, DIAGONAL);
        alpha = covered_box(p * diagonal, vec2(place.z * DIAGONAL), box_widths(pixel, axes * diagonal));
        inside_mm = (place.z - abs(p.x) - abs(p.y)) * DIAGONAL;
    } else if (triangle) {
        inside_mm = inside_triangle(p, place.zw);
        alpha = clamp(0.5 + inside_mm / pixel.mean_mm, 0.0, 1.0);
    }
    vec4 ink = decal_texel(decal, 2);
    vec3 albedo = ink.rgb;
    vec2 uv = p / (2.0 * place.zw) + 0.5;
    if (kind == DECAL_TEXT) {
        // Letters have their own coverage. Only what they have below the baseline ends with the box.
        vec2 inside_px = inside / width_mm;
        alpha = clamp(2.0 + min(inside_px.x, inside_px.y), 0.0, 1.0);
        if (alpha > 0.0) alpha *= text_coverage(p, decal_texel(decal, 4), width_mm);
    } else if (kind == DECAL_STRIPES) {
        float period_mm = 4.0 * place.w;
        float wave = abs(fract((p.x + p.y) / period_mm) - 0.5) * period_mm - 0.25 * period_mm;
        albedo = mix(vec3(0.012), ink.rgb, clamp(0.5 + wave / pixel.mean_mm, 0.0, 1.0));
    } else if (kind != DECAL_PATCH) {
        float lod = log2(pixel.mean_mm * ART_SIZE * 0.5 * inversesqrt(place.z * place.w));
        // Half a level finer, because trilinear filtering widens the footprint by about as much. Small
        // artwork needs the width, or its light depends on where the pixels lie.
        float sharper = 0.5 - 0.5 * smoothstep(5.0, 6.5, lod);
        vec4 texel = textureLod(art, vec3(uv.x, 1.0 - uv.y, about.z), max(lod - sharper, 0.0));
        // Outlines of markers and triangles are exact nearby. Farther away the artwork's own coverage,
        // which is filtered as its light, keeps the balance of both.
        float exact = diamond || triangle ? 1.0 - smoothstep(0.25, 1.25, lod) : 0.0;
        alpha = mix(rectangle * texel.a, alpha, exact);
        if (kind != DECAL_EMBLEM) {
            vec4 aged = worn_art(texel.rgb / max(texel.a, 0.004), ink.rgb, ink.a, about.w, coarse, streaks);
            alpha *= aged.a * left_after_tear(p, place.zw, decal_texel(decal, 4), diamond, small, pixel.mean_mm,
                                              coarse);
            albedo = aged.rgb;
        }
    }
    // Painted decals wear off in flakes.
    if (!diamond && !triangle && kind != DECAL_STICKER)
        alpha *= 1.0 - ink.a * covered(coarse.value.w, 0.6, coarse.lost.w, 0.15);
    alpha = min(alpha * seen_share(pixel, turn.zw), 1.0);
    hit.ink = mix(hit.ink, albedo, alpha);
    hit.alpha += alpha * (1.0 - hit.alpha);
    if (kind == DECAL_PATCH) hit.patched += alpha * (1.0 - hit.patched);
    if (inside_mm >= 0.0 && about.y > 0.0) hit.id = uint(about.y);
}

DecalHit decals_at(int sheet, vec2 atlas_mm, Footprint pixel, NoiseSample coarse, NoiseSample streaks) {
    DecalHit hit = NO_DECAL;
    int layer = 0;
    do {
        uvec4 cell = cell_at(sheet, atlas_mm, layer);
        int i = 0;
        uint decal = cell.x & 0xffffu;
        do {
            if (decal != 0u) add_decal(hit, decal, sheet, atlas_mm, pixel, coarse, streaks);
            ++i;
            uint pair = cell[(i & 7) >> 1];
            decal = (i & 1) == 0 ? pair & 0xffffu : pair >> 16;
        } while (i < 8 && decal != 0u);
    } while (++layer < decal_layers);
    return hit;
}
