// uvec4 cell_at(zone, sheet_mm): the decals that may cover a point of the sheet; none on the spreader.

uniform usampler2D decal_grid;   // up to 8 decal numbers (1-based, 0: none) a cell in 16 bits each, bottom first

uvec4 cell_at(uint zone, vec2 sheet_mm) {
    bool bears = zone < SPREADER_ZONE;   // the grid spans the container's atlas only
    uvec4 cell = texelFetch(decal_grid, bears ? ivec2(sheet_mm / DECAL_CELL_MM) : ivec2(0), 0);
    return bears ? cell : uvec4(0u);
}
