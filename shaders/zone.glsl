// What is known of each zone of the atlas (fastgen/drawing/gpu_mesh.py). bool before_sheet(zone): whether it is
// of the door's bars; vec2 upright(sheet_mm, code): turned so that +y is up in the world; float
// to_upper_side(from_low, size, code): distance to the side of a zone that is up.

uniform sampler2D zone_table;   // row 0: x0, y0, width, height in mm; row 1: code, and of panels and
                                // door gear their face's outward axis, else 0
// code: material, quarter turns clockwise from +y to up, bits of gear, small pieces, what is level

bool before_sheet(uint zone) {
    return (int(texelFetch(zone_table, ivec2(int(zone), 1), 0).x) & ZONE_GEAR) != 0;
}

int quarter_turns(int code) { return code / ZONE_TURN & 3; }

vec2 upright(vec2 sheet_mm, int code) {
    int turns = quarter_turns(code);
    vec2 turned = (turns & 1) == 0 ? sheet_mm : vec2(-sheet_mm.y, sheet_mm.x);
    return (turns & 2) == 0 ? turned : -turned;
}

float to_upper_side(vec2 from_low, vec2 size, int code) {
    int turns = quarter_turns(code);
    vec2 left = turns < 2 ? size - from_low : from_low;
    return (turns & 1) == 0 ? left.y : left.x;
}
