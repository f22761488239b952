// void list_pixel(uint list, ivec2), uint listed_pixels(), ivec2 listed_pixel(uint): the pixels of each
// class, in any order. A compute shader takes them one after the other, where fragments come in blocks
// of pixels of which an edge fills few.

layout(std430, binding = LIST_BINDING) buffer PixelLists {
    uint list_heads[LIST_HEADER * LISTS];   // the three numbers of the indirect dispatch that works a
                                            // list off, and its length
    uint list_pixels[];                     // x | y << 16, as much room for each list
};

uint list_start(uint list) { return list * (uint(list_pixels.length()) / LISTS); }

void list_pixel(uint list, ivec2 pixel) {
    uint head = LIST_HEADER * list;
    uint at = atomicAdd(list_heads[head + 3u], 1u);
    if (at % LIST_GROUP == 0u) atomicAdd(list_heads[head], 1u);
    list_pixels[list_start(list) + at] = uint(pixel.x) | (uint(pixel.y) << 16);
}

// of the class that a program shades
uint listed_pixels() { return list_heads[LIST_HEADER * LIST + 3u]; }

ivec2 listed_pixel(uint at) {
    uint pixel = list_pixels[list_start(LIST) + at];
    return ivec2(pixel & 0xffffu, pixel >> 16);
}
