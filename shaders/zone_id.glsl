// uint zone_id(uint zone): value in the id image of a surface without decals.

#include "labels.constants"
#include "zones.constants"
#include "scene.block"

uint zone_id(uint zone) {
    if (zone >= SPREADER_ZONE) return SPREADER_ID;
    return zone >= SEAL_ZONE ? uint(first_seal_id) + (zone - SEAL_ZONE) / SEAL_PARTS
                             : uint(container_id);
}
