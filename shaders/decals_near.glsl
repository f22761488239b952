// bool near_decals(zone, sheet_mm): whether a lookup of the layers at a point of the sheet may meet a decal;
// none is on the spreader.

uniform usampler2D decal_cells;   // drawing/decals_near.py

bool near_decals(uint zone, vec2 sheet_mm) {
    bool bears = zone < SPREADER_ZONE;   // the cells span the container's atlas only
    return bears && texelFetch(decal_cells, ivec2(sheet_mm / NEAR_CELL_MM), 0).r != 0u;
}
