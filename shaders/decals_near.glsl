// bool near_decals(uint zone, vec2 atlas_mm): whether a material lookup at this atlas position may
// touch a decal. It is false on seals and spreader, which have no decals.

#include "decals.constants"
#include "zones.constants"

// Cells of decals_near.py, one byte each. Four are packed into a texel, the first in the lowest byte,
// because llvmpipe fetches one-byte texels one by one.
uniform usampler2D decal_proximity;

bool near_decals(uint zone, vec2 atlas_mm) {
    bool bears = zone < SEAL_ZONE;   // The cells span the container's atlas only.
    ivec2 cell = ivec2(atlas_mm / NEAR_CELL_MM);
    uint four = texelFetch(decal_proximity, ivec2(cell.x >> 2, cell.y), 0).r;
    return bears && (four & 0xffu << 8 * (cell.x & 3)) != 0u;
}
