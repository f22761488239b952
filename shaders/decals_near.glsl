// bool near_decals(zone, sheet_mm): whether a lookup of the layers at a point of the sheet may meet a decal;
// none is on the spreader.

// cells of drawing/decals_near.py, four a number, the first in its lowest byte: llvmpipe fetches single
// bytes one by one
uniform usampler2D decal_cells;

bool near_decals(uint zone, vec2 sheet_mm) {
    bool bears = zone < SPREADER_ZONE;   // the cells span the container's atlas only
    ivec2 cell = ivec2(sheet_mm / NEAR_CELL_MM);
    uint four = texelFetch(decal_cells, ivec2(cell.x >> 2, cell.y), 0).r;
    return bears && (four & 0xffu << 8 * (cell.x & 3)) != 0u;
}
