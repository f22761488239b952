// uint zone_id(uint zone): value in the id image of a surface without decals.

#include "labels.constants"
#include "zones.constants"

uint zone_id(uint zone) {
    if (zone >= SPREADER_ZONE) return SPREADER_ID;
    return zone >= SEAL_ZONE ? SEAL_ID + (zone - SEAL_ZONE) / SEAL_PARTS : CONTAINER_ID;
}
