// Directional light i, extracted from the HDRI: the sun or a lamp. Light 0 is the brightest.
// vec3 sunlit(Reflector r, int i): its radiance reflected toward the eye, without shadow.
// float sun_at(vec3 from_eye, int i): unshadowed share of light i at a point, 0..1.
// float first_sun_share(vec3 from_eye, vec3 normal, float footprint_m): mean share of light 0 over a
// pixel. vec3 sun_thrown(...): irradiance / pi of light i on the occluders of a point.
// from_eye: Vector from the eye to the point in m.

#include "reflectance.constants"
#include "shadow.constants"
#include "units.constants"
#include "view.block"

uniform sampler2DShadow sun_shadow;   // One tile per light, and light 0's end tile.

// Texture coordinates and depth of a point in the tile of light i.
vec3 shadow_place(vec3 from_eye, int i) {
    return (ray_to_shadow[i] * vec4(from_eye, 1.0)).xyz;
}

// Points outside a tile are lit: lookups are clamped to its edge, where nothing is drawn.
float sun_at_place(vec3 at, vec4 tile) {
    return textureLod(sun_shadow, vec3(clamp(at.xy, tile.xy, tile.zw), at.z), 0.0);
}

// Position of a shadow lookup for light 0. A finer tile shows the end of the container on which the
// light shines.
struct FirstPlace {
    vec3 at;
    vec2 scale;   // Magnification relative to the first tile.
    vec4 tile;    // Bounds of lookups.
};

FirstPlace first_place(vec3 from_eye) {
    vec3 at = shadow_place(from_eye, 0);
    vec2 fine = fma(at.xy, to_end_tile.xy, to_end_tile.zw);
    bool end = all(greaterThan(fine, end_tile.xy)) && all(lessThan(fine, end_tile.zw)) &&
               end_from.x * from_eye.x > end_from.y;
    return end ? FirstPlace(vec3(fine, at.z), to_end_tile.xy, vec4(0.0, 0.0, 1.0, 1.0))
               : FirstPlace(at, vec2(1.0), sun_tile[0]);
}

float sun_at(vec3 from_eye, int i) {
    if (i > 0) return sun_at_place(shadow_place(from_eye, i), sun_tile[i]);
    FirstPlace place = first_place(from_eye);
    return sun_at_place(place.at, place.tile);
}

vec3 sunlit(Reflector r, int i) {
    Material m = r.material;
    vec3 toward = sun_toward[i].xyz;
    float n_dot_v = max(r.n_dot_v, 1e-3);
    float n_dot_l = max(dot(r.normal, toward), 0.0);
    vec3 half_way = normalize(r.view + toward);
    float n_dot_h = max(dot(r.normal, half_way), 0.0);
    // The light's disc spreads half vectors by half its radius (after Karis 2013, area lights).
    float alpha = m.roughness * m.roughness + 0.5 * sun_toward[i].w;
    float a2 = alpha * alpha;
    // GGX distribution: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces,
    // eq. 33. Masking and shadowing: Heitz 2014, Understanding the Masking-Shadowing Function, eq. 99.
    float d = fma(n_dot_h * n_dot_h, a2 - 1.0, 1.0);
    float distribution = a2 / (d * d);   // Times pi, because sun_light is irradiance / pi.
    float masking = 0.5 / (n_dot_l * sqrt(fma(n_dot_v * n_dot_v, 1.0 - a2, a2)) +
                           n_dot_v * sqrt(fma(n_dot_l * n_dot_l, 1.0 - a2, a2)) + 1e-5);
    float grazing = fresnel_climb(clamp(dot(r.view, half_way), 0.0, 1.0));
    vec3 metal = mix(m.albedo, vec3(1.0), grazing) * (1.0 + m.albedo * r.gain);
    float dielectric = mix(DIELECTRIC_F0, 1.0, grazing) * (1.0 + DIELECTRIC_F0 * r.gain);
    vec3 specular = mix(vec3(dielectric), metal, m.metallic) * (distribution * masking);
    return (r.diffuse + specular) * sun_light[i].rgb * n_dot_l;
}

// Percentage-closer filtering (Reeves et al. 1987, Rendering Antialiased Shadows with Depth Maps) over
// the pixel's footprint, or at least SHADOW_TEXELS, which hides the map's texels. Other lights have
// one lookup. One function for all would be too large for Mesa to unroll the loop over lights.
float first_sun_share(vec3 from_eye, vec3 normal, float footprint_m) {
    FirstPlace place = first_place(from_eye);
    vec3 at = place.at;
    mat3 axes = transpose(mat3(ray_to_shadow[0]));   // Axes of the map, in its units per metre.
    axes[0] *= place.scale.x;
    axes[1] *= place.scale.y;
    vec3 squared = vec3(dot(axes[0], axes[0]), dot(axes[1], axes[1]), dot(axes[2], axes[2]));
    vec2 texels = SHADOW_TEXELS / vec2(textureSize(sun_shadow, 0));
    vec2 reach = max(texels, min(0.22 * footprint_m, 0.03) * sqrt(squared.xy));
    // A rotated grid: each lookup has its own row and column.
    vec3 u = vec3(reach * vec2(0.75, 0.25), 0.0), v = vec3(reach * vec2(-0.25, 0.75), 0.0);
    // Lookups follow the plane of the surface in depth.
    vec3 plane = normal * axes / squared;
    vec2 slope = plane.xy / min(plane.z, -1e-3);
    u.z = -dot(slope, u.xy);
    v.z = -dot(slope, v.xy);
    return 0.25 * (sun_at_place(at + u, place.tile) + sun_at_place(at - u, place.tile) +
                   sun_at_place(at + v, place.tile) + sun_at_place(at - v, place.tile));
}

// Irradiance / pi of light i on the occluders, times the share of the hemisphere that they hide. The
// occluder is modelled as a wall at right angles to the surface. It faces the direction of the bent
// normal along the surface, or stands all around if there is none. It is lit if the light reaches a
// place near the point. A low light shines on sides of an overhead spreader that the surface does not
// see: the factor `seen` is fitted to rays below spreaders.
vec3 sun_thrown(vec3 from_eye, vec3 normal, Openness sky, int i) {
    vec3 toward = sun_toward[i].xyz;
    vec3 aside = leaning(sky, normal);
    float most = length(aside);
    // Mean cosine of the light on walls all around.
    float walled = length(toward - normal * dot(normal, toward)) / PI;
    float facing = mix(walled, max(dot(aside, toward), 0.0) / max(most, 1e-3),
                       smoothstep(0.0, 0.1, most));
    float lit = sun_at(from_eye + 0.02 * sky.direction, i);
    float seen = mix(1.0, clamp(3.0 * dot(normal, toward), 0.0, 1.0), sky.hung);
    return sky.rim * sky.rim * facing * lit * seen * sun_light[i].rgb;
}
