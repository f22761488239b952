// int sheet_number(int code): number of the sheet that a zone belongs to, 0 if decals never lie there.
// bool is_door_gear(uint zone): whether a zone belongs to door gear, which is in front of the sheet.
// vec2 upright(vec2 atlas_mm, int code): atlas position, turned so that +y is up in the world.
// float to_upper_side(vec2 from_low, vec2 size, int code): distance in mm to a zone's upper side.
// A zone is a part of the atlas that weathers on its own, such as one side of a beam.

#include "zones.constants"

// One column per zone, made by gpu_mesh.py. Row 0: x0, y0, width, height in mm. Row 1: code, and the
// outward axis of the face for panels and door gear, else 0. The code holds the material, the quarter
// turns clockwise from +y to up, bits for door gear, small pieces and level zones, and the number of the
// sheet. Row 2: corrugation, see fold_row in rust.py, and SheetFolds.stretch of the sheet.
uniform sampler2D zone_table;

bool is_door_gear(uint zone) {
    return (int(texelFetch(zone_table, ivec2(int(zone), 1), 0).x) & ZONE_GEAR) != 0;
}

int sheet_number(int code) { return code / ZONE_SHEET; }

int quarter_turns(int code) { return code / ZONE_TURN & 3; }

vec2 upright(vec2 atlas_mm, int code) {
    int turns = quarter_turns(code);
    vec2 turned = (turns & 1) == 0 ? atlas_mm : vec2(-atlas_mm.y, atlas_mm.x);
    return (turns & 2) == 0 ? turned : -turned;
}

float to_upper_side(vec2 from_low, vec2 size, int code) {
    int turns = quarter_turns(code);
    vec2 left = turns < 2 ? size - from_low : from_low;
    return (turns & 1) == 0 ? left.y : left.x;
}
