// struct Shaded: colour and labels of one pixel.

struct Shaded {
    vec3 color;   // Exposed radiance; in a single-layer image the value to show. shade_mixed and, with
                  // OVER, shade_behind give display colour unless RADIANCE is set.
    uint id;
    uint damage;
    float depth;
    float cover;   // Share of the pixel that does not show the panorama.
};
