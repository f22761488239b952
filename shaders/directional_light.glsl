// Directional light i, extracted from the HDRI: the sun or a lamp. Light 0 is the brightest.
// vec3 light_reflection(BrdfTerms r, int i): its radiance reflected toward the eye, without shadow.
// float light_visibility(vec3 from_eye, int i): unshadowed share of light i at a point, 0..1.
// float filtered_light_visibility(vec3 from_eye, vec3 normal, float footprint_m): mean share of light 0 over a
// pixel. vec3 occluder_light(...): irradiance / pi of light i on the occluders of a point.
// from_eye: Vector from the eye to the point in m.

#include "reflectance.constants"
#include "shadow.constants"
#include "units.constants"
#include "view.block"

uniform sampler2DShadow shadow_map;   // One tile per light, and light 0's end tile.

// Texture coordinates and depth of a point in the tile of light i.
vec3 shadow_position(vec3 from_eye, int i) {
    return (ray_to_shadow[i] * vec4(from_eye, 1.0)).xyz;
}

// Points outside a tile are lit: lookups are clamped to its edge, where nothing is drawn.
float shadow_lookup(vec3 at, vec4 tile) {
    return textureLod(shadow_map, vec3(clamp(at.xy, tile.xy, tile.zw), at.z), 0.0);
}

// Position of a shadow lookup for light 0. A finer tile shows the end of the container on which the
// light shines.
struct MainShadowPosition {
    vec3 at;
    vec2 scale;   // Magnification relative to the first tile.
    vec4 tile;    // Bounds of lookups.
};

MainShadowPosition main_shadow_position(vec3 from_eye) {
    vec3 at = shadow_position(from_eye, 0);
    vec2 fine = fma(at.xy, shadow_end_transform.xy, shadow_end_transform.zw);
    bool end = all(greaterThan(fine, shadow_end_bounds.xy)) && all(lessThan(fine, shadow_end_bounds.zw)) &&
               shadow_end_plane.x * from_eye.x > shadow_end_plane.y;
    return end ? MainShadowPosition(vec3(fine, at.z), shadow_end_transform.xy, vec4(0.0, 0.0, 1.0, 1.0))
               : MainShadowPosition(at, vec2(1.0), shadow_tile[0]);
}

float light_visibility(vec3 from_eye, int i) {
    if (i > 0) return shadow_lookup(shadow_position(from_eye, i), shadow_tile[i]);
    MainShadowPosition place = main_shadow_position(from_eye);
    return shadow_lookup(place.at, place.tile);
}

vec3 light_reflection(BrdfTerms r, int i) {
    Material m = r.material;
    vec3 toward = light_direction[i].xyz;
    float n_dot_v = max(r.n_dot_v, 1e-3);
    float n_dot_l = max(dot(r.normal, toward), 0.0);
    vec3 half_way = normalize(r.view + toward);
    float n_dot_h = max(dot(r.normal, half_way), 0.0);
    // The light's disc spreads half vectors by half its radius (after Karis 2013, area lights).
    float alpha = m.roughness * m.roughness + 0.5 * light_direction[i].w;
    float a2 = alpha * alpha;
    // GGX distribution: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces,
    // eq. 33. Masking and shadowing: Heitz 2014, Understanding the Masking-Shadowing Function, eq. 99.
    float d = fma(n_dot_h * n_dot_h, a2 - 1.0, 1.0);
    float distribution = a2 / (d * d);   // Times pi, because light_irradiance is irradiance / pi.
    float masking = 0.5 / (n_dot_l * sqrt(fma(n_dot_v * n_dot_v, 1.0 - a2, a2)) +
                           n_dot_v * sqrt(fma(n_dot_l * n_dot_l, 1.0 - a2, a2)) + 1e-5);
    float grazing = fresnel_climb(clamp(dot(r.view, half_way), 0.0, 1.0));
    vec3 metal = mix(m.albedo, vec3(1.0), grazing) * (1.0 + m.albedo * r.gain);
    float dielectric = mix(DIELECTRIC_F0, 1.0, grazing) * (1.0 + DIELECTRIC_F0 * r.gain);
    vec3 specular = mix(vec3(dielectric), metal, m.metallic) * (distribution * masking);
    return (r.diffuse + specular) * light_irradiance[i].rgb * n_dot_l;
}

// Percentage-closer filtering (Reeves et al. 1987, Rendering Antialiased Shadows with Depth Maps) over
// the pixel's footprint, or at least SHADOW_TEXELS, which hides the map's texels. Other lights have
// one lookup. One function for all would be too large for Mesa to unroll the loop over lights.
float filtered_light_visibility(vec3 from_eye, vec3 normal, float footprint_m) {
    MainShadowPosition place = main_shadow_position(from_eye);
    vec3 at = place.at;
    mat3 axes = transpose(mat3(ray_to_shadow[0]));   // Axes of the map, in its units per metre.
    axes[0] *= place.scale.x;
    axes[1] *= place.scale.y;
    vec3 squared = vec3(dot(axes[0], axes[0]), dot(axes[1], axes[1]), dot(axes[2], axes[2]));
    vec2 texels = SHADOW_TEXELS / vec2(textureSize(shadow_map, 0));
    vec2 reach = max(texels, min(0.22 * footprint_m, 0.03) * sqrt(squared.xy));
    // A rotated grid: each lookup has its own row and column.
    vec3 u = vec3(reach * vec2(0.75, 0.25), 0.0), v = vec3(reach * vec2(-0.25, 0.75), 0.0);
    // Lookups follow the plane of the surface in depth.
    vec3 plane = normal * axes / squared;
    vec2 slope = plane.xy / min(plane.z, -1e-3);
    u.z = -dot(slope, u.xy);
    v.z = -dot(slope, v.xy);
    return 0.25 * (shadow_lookup(at + u, place.tile) + shadow_lookup(at - u, place.tile) +
                   shadow_lookup(at + v, place.tile) + shadow_lookup(at - v, place.tile));
}

// Irradiance / pi of light i on the occluders, times the share of the hemisphere that they hide. The
// occluder is modelled as a wall at right angles to the surface. It faces the direction of the bent
// normal along the surface, or stands all around if there is none. It is lit if the light reaches a
// place near the point. A low light shines on sides of an overhead spreader that the surface does not
// see: the factor `seen` is fitted to rays below spreaders.
vec3 occluder_light(vec3 from_eye, vec3 normal, SkyVisibility sky, int i) {
    vec3 toward = light_direction[i].xyz;
    vec3 aside = bent_normal_tangent(sky, normal);
    float most = length(aside);
    // Mean cosine of the light on walls all around.
    float walled = length(toward - normal * dot(normal, toward)) / PI;
    float facing = mix(walled, max(dot(aside, toward), 0.0) / max(most, 1e-3),
                       smoothstep(0.0, 0.1, most));
    float lit = light_visibility(from_eye + 0.02 * sky.bent_normal, i);
    float seen = mix(1.0, clamp(3.0 * dot(normal, toward), 0.0, 1.0), sky.overhead);
    return sky.cone_cosine * sky.cone_cosine * facing * lit * seen * light_irradiance[i].rgb;
}
