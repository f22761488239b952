// uint listed(uint list, uint count): index of the first of `count` new entries of a list.
// uint pixels_listed(): length of the list that this program shades.
// ivec2 listed_pixel(uint at): pixel at entry `at` of the same list.
// There is one unordered list per pixel class. Compute shaders work through a list without idle lanes.
// Fragment shaders run on blocks of pixels, and an edge fills few pixels of a block.

#include "pixel_list.constants"

layout(std430, binding = LIST_BINDING) buffer PixelLists {
    uint list_heads[LIST_HEADER * LISTS];   // Per list: the three numbers of its indirect
                                            // dispatch, then its length.
    uint list_entries[];                    // The same capacity for each list.
};

uint list_start(uint list) { return list * (uint(list_entries.length()) / LISTS); }

uint listed(uint list, uint count) {
    uint head = LIST_HEADER * list;
    uint at = atomicAdd(list_heads[head + 3u], count);
    uint groups = (at + count + LIST_GROUP - 1u) / LIST_GROUP;
    if (groups > (at + LIST_GROUP - 1u) / LIST_GROUP) atomicMax(list_heads[head], groups);
    return list_start(list) + at;
}

uint list_entry(ivec2 pixel) { return uint(pixel.x) | uint(pixel.y) << 16; }

uint pixels_listed() { return list_heads[LIST_HEADER * LIST + 3u]; }

ivec2 listed_pixel(uint at) {
    uint entry = list_entries[list_start(LIST) + at];
    return ivec2(entry & 0xffffu, entry >> 16);
}
