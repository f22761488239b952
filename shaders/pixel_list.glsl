// void list_pixel(ivec2), uint listed_pixels(), ivec2 listed_pixel(uint): the pixels of one class, in
// any order. A compute shader takes them one after the other, where fragments come in blocks of
// pixels of which an edge fills few.

layout(std430, binding = LIST_BINDING) buffer PixelList {
    uint list_groups[3];    // the indirect dispatch that works the list off
    uint list_length;
    uint list_pixels[];     // x | y << 16
};

void list_pixel(ivec2 pixel) {
    uint at = atomicAdd(list_length, 1u);
    if (at % LIST_GROUP == 0u) atomicAdd(list_groups[0], 1u);
    list_pixels[at] = uint(pixel.x) | (uint(pixel.y) << 16);
}

uint listed_pixels() { return list_length; }

ivec2 listed_pixel(uint at) { return ivec2(list_pixels[at] & 0xffffu, list_pixels[at] >> 16); }
