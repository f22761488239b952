// uint listed(uint list, uint count), uint pixels_listed(), uint listed_at(uint): the pixels of each class,
// in any order. A compute shader takes them one after the other, where fragments come in blocks
// of pixels of which an edge fills few.

layout(std430, binding = LIST_BINDING) buffer PixelLists {
    uint list_heads[LIST_HEADER * LISTS];   // the three numbers of the indirect dispatch that works a
                                            // list off, and its length
    uint list_entries[];                    // as much room for each list
};

uint list_start(uint list) { return list * (uint(list_entries.length()) / LISTS); }

// room for `count` entries more in a list: where in list_entries it begins
uint listed(uint list, uint count) {
    uint head = LIST_HEADER * list;
    uint at = atomicAdd(list_heads[head + 3u], count);
    uint groups = (at + count + LIST_GROUP - 1u) / LIST_GROUP;
    if (groups > (at + LIST_GROUP - 1u) / LIST_GROUP) atomicMax(list_heads[head], groups);
    return list_start(list) + at;
}

// group: which of two by two pixels from there on, row by row, a bit each
uint list_entry(ivec2 pixel, uint group) { return uint(pixel.x) | uint(pixel.y) << 14 | group << 28; }

// of the class that a program shades
uint pixels_listed() { return list_heads[LIST_HEADER * LIST + 3u]; }

uint listed_at(uint at) { return list_entries[list_start(LIST) + at]; }

ivec2 listed_pixel(uint entry) { return ivec2(entry & 0x3fffu, entry >> 14 & 0x3fffu); }

uint listed_group(uint entry) { return entry >> 28; }

// the place of a pixel of a group, by its bit
ivec2 in_group(int bit) { return ivec2(bit & 1, bit >> 1); }
