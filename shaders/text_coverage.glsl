// float text_coverage(vec2 p, vec4 run, vec2 width_mm): ink coverage of a text in a box of width_mm around p,
// which is in mm from its middle. run: The fifth texel of the decal's row.

#include "decals.constants"

uniform sampler2D glyph_table;      // One texel per letter; see GlyphRun in glyph_runs.py.
uniform sampler2DArray glyph_tiles; // Signed distance, 0.5 on the outline.
uniform sampler2DArray glyph_sums;  // Share of the tile's ink to the left and above, see glyph_sums.

// Share of a glyph's ink left of and above a place in its tile, in texels from the upper left.
float ink_before(vec2 place, float layer) {
    return texture(glyph_sums, vec3((place - 0.5) / GLYPH_TILE_SIZE, layer)).r;
}

// Ink coverage of one glyph in a box at d mm from its centre. Four sums give the exact mean of the ink in
// the box (Crow 1984, Summed-Area Tables for Texture Mapping), so that a small letter keeps its ink wherever
// the pixels lie. The distance field gives sharp outlines nearby (Green 2007, Improved Alpha-Tested
// Magnification for Vector Textures and Special Effects).
float glyph_ink(vec2 d, float layer, float tile_mm, vec2 width_mm) {
    float texel_mm = tile_mm / GLYPH_TILE_SIZE;
    vec2 center = vec2(d.x, -d.y) / texel_mm + 0.5 * GLYPH_TILE_SIZE;
    vec2 width = width_mm / texel_mm;
    vec2 low = center - 0.5 * width, high = center + 0.5 * width;
    float ink = ink_before(high, layer) - ink_before(vec2(low.x, high.y), layer) -
                ink_before(vec2(high.x, low.y), layer) + ink_before(low, layer);
    float mean_width = sqrt(width.x * width.y);
    float filtered = ink * GLYPH_MOST_INK / (width.x * width.y);
    float distance = (texture(glyph_tiles, vec3(center / GLYPH_TILE_SIZE, layer)).r - 0.5) *
                     (GLYPH_RANGE_CAPS / GLYPH_TILE_CAPS * GLYPH_TILE_SIZE);
    float sharp = clamp(0.5 + distance / mean_width, 0.0, 1.0);
    return mix(sharp, filtered, smoothstep(1.2, 2.4, mean_width));
}

vec4 glyph_texel(uint glyph) { return texelFetch(glyph_table, ivec2(glyph & 255u, glyph >> 8), 0); }

// Code of the letters that reach into the part of a text at a distance along its longer side.
uint glyphs_at(float along_mm, vec4 run) {
    float part = clamp(fma(along_mm, abs(run.w), 0.5 * run.z), 0.0, run.z - 1.0);
    return uint(glyph_texel(uint(run.y) + uint(part)).w);
}

float text_coverage(vec2 p, vec4 run, vec2 width_mm) {
    float tile_mm = GLYPH_TILE_CAPS * run.x;
    float step_mm = tile_mm / float(GLYPH_EXTENT_STEPS);
    bool down = run.w < 0.0;
    float along = down ? p.y : p.x, reach = 0.5 * (down ? width_mm.y : width_mm.x);
    uint start = uint(run.y);
    uint g = start + glyphs_at(along - reach, run) / GLYPH_RANGE;
    uint end = start + glyphs_at(along + reach, run) % GLYPH_RANGE;
    float ink = 0.0;
    do {
        // Skips to the next letter that the box touches, because texture lookups cost most.
        uint tile;
        vec2 d;
        bool touched;
        do {
            vec4 glyph = glyph_texel(g);
            uint code = uint(glyph.z);
            tile = code / (GLYPH_EXTENT_STEPS * GLYPH_EXTENT_STEPS);
            vec2 ink_steps = vec2(code / GLYPH_EXTENT_STEPS % GLYPH_EXTENT_STEPS, code % GLYPH_EXTENT_STEPS);
            d = p - glyph.xy;
            touched = g < end && all(lessThan(abs(d), step_mm * ink_steps + 0.5 * width_mm));
        } while (!touched && ++g < end);
        if (touched) ink += glyph_ink(d, float(tile), tile_mm, width_mm);
    } while (++g < end);
    return clamp(ink, 0.0, 1.0);
}
