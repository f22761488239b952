// ZonePoint zone_point(vec4 rect, vec4 folds, int code, vec2 atlas_mm, float footprint_mm): place of a point
// in its zone, relative to the edges and folds where steel rusts, collects dirt or is scraped.
// rect, folds: Rows 0 and 2 of the zone table. footprint_mm: Width of the lookup on the surface.

#include "rust.constants"
#include "zones.constants"
#include "zone.glsl"

struct ZonePoint {
    float edge_mm;     // Distance to the zone's nearest edge.
    float corner_mm;   // Distance to its nearest corner.
    float narrow_mm;   // Its shorter side.
    float below_mm;    // Distance to its upper edge.
    float above_mm;    // Distance to its lower edge.
    float steep;       // 0 if the zone is level, else 1.
    float raised;      // Share of the footprint on outer flats of a corrugation; 1 without one.
    float fold;        // Closeness to the folds beside them, 0..1; 0 without.
};

ZonePoint zone_point(vec4 rect, vec4 folds, int code, vec2 atlas_mm, float footprint_mm) {
    vec2 from_low = atlas_mm - rect.xy;
    vec2 to_border = min(from_low, rect.zw - from_low);
    ZonePoint z;
    z.edge_mm = max(min(to_border.x, to_border.y), 0.0);
    z.corner_mm = length(max(to_border, 0.0));
    z.narrow_mm = min(rect.z, rect.w);
    z.below_mm = to_upper_side(from_low, rect.zw, code);
    z.above_mm = ((code & ZONE_TURN) == 0 ? rect.w : rect.z) - z.below_mm;
    z.steep = (code & ZONE_LEVEL) == 0 ? 1.0 : 0.0;
    if ((code & ZONE_SMALL) != 0) {
        z.edge_mm = z.corner_mm = z.below_mm = z.above_mm = SMALL_EDGE_MM;
        z.narrow_mm = SMALL_WIDE_MM;
    }
    float inside_mm = folds.z - abs(fract((from_low.x - folds.y) / folds.x) - 0.5) * folds.x;
    z.raised = clamp(0.5 + inside_mm / max(footprint_mm, FOLD_REACH_MM), 0.0, 1.0);
    // A wide footprint sees the mean of its neighbourhood.
    float reach_mm = max(FOLD_REACH_MM, 0.5 * footprint_mm);
    z.fold = FOLD_REACH_MM / reach_mm * exp(-abs(inside_mm) / reach_mm);
    return z;
}
