// uvec4 cell_at(uint zone, vec2 atlas_mm): up to 8 decals that may cover a point of the atlas.
// All bits are 0 on seals and spreader, which have no decals.

#include "decals.constants"
#include "zones.constants"

// Decal numbers of each cell, 16 bits each, bottom decal first; 1-based, 0 for none.
uniform usampler2D decal_grid;

uvec4 cell_at(uint zone, vec2 atlas_mm) {
    bool bears = zone < SEAL_ZONE;   // The grid spans the container's atlas only.
    uvec4 cell = texelFetch(decal_grid, bears ? ivec2(atlas_mm / DECAL_CELL_MM) : ivec2(0), 0);
    return bears ? cell : uvec4(0u);
}
