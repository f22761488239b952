// struct SkyVisibility: visible sky and occluders of a surface point.
// struct TracedLight: light at a point, found by rays.
// fastgen/light/sky_visibility.py computes and encodes them.

struct TracedLight {
    vec3 sky_share;          // Share of the whole sky's irradiance that arrives.
    vec3 indirect;           // Irradiance / pi of indirect light.
    vec3 mirror_sky_share;   // Share of the sky's mirrored radiance that arrives.
    vec3 mirror_indirect;    // Mirrored radiance of other surfaces.
    float weight;            // Weight of the rays found; 0 without rays.
};

const TracedLight NO_TRACED_LIGHT = TracedLight(vec3(1.0), vec3(0.0), vec3(1.0), vec3(0.0), 0.0);

// Sky visibility of a point, and its occluders: the surfaces that hide a share of its hemisphere.
// `traced` replaces all of it if traced.weight > 0.
struct SkyVisibility {
    vec3 bent_normal;       // Mean direction of the visible sky.
    float cone_cosine;      // Cosine of the half-angle of the cone of visible sky.
    vec3 irradiance;        // Of the visible sky, relative to a whole sky about the bent normal.
    float mirror;           // Share of open sky about the mirror direction.
    float lacks_indirect;   // 1 if `irradiance` lacks light reflected by the occluders, else 0.
    vec3 occluder_albedo;   // Albedo of the occluders.
    TracedLight traced;
};
