// struct Shaded: colour and labels of one pixel.

struct Shaded {
    vec3 color;   // Exposed radiance; in a single-layer image the value to show.
    uint id;
    uint damage;
    float depth;
    float cover;   // Share of the pixel that is not sky.
};
