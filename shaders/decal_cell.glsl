// uvec4 cell_at(int sheet, vec2 atlas_mm, int layer): up to 8 decals that may cover a point of the atlas.
// All bits are 0 off the sheets, where decals never lie. Cells with more decals continue in further layers.

#include "scene.block"

// Decal numbers of each cell, 16 bits each, bottom decal first; 1-based, 0 for none. The layers of a cell
// are below one another.
uniform usampler2D decal_grid;

uvec4 cell_at(int sheet, vec2 atlas_mm, int layer) {
    bool bears = sheet > 0;   // The grid spans the container's atlas only.
    ivec2 at = bears ? ivec2(atlas_mm / decal_cell_mm) : ivec2(0);
    uvec4 cell = texelFetch(decal_grid, ivec2(at.x, at.y * decal_layers + layer), 0);
    return bears ? cell : uvec4(0u);
}
