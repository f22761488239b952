// Of sun i, the sun itself or a lamp:
// vec3 sunlit(Reflector r, int i): its radiance reflected toward the eye, unshadowed;
// float sun_at(vec3 from_eye, int i): how much of it gets there, 0..1;
// float first_sun_share(vec3 from_eye, vec3 normal, float footprint_m): the same over a pixel, i = 0;
// vec3 sun_thrown(vec3 from_eye, vec3 normal, Openness sky, int i): what it throws on what hides the sky.
// from_eye: to the point, in m.

uniform sampler2DShadow sun_shadow;   // a tile for each, and the first sun's of the end that it shines on

vec3 shadow_place(vec3 from_eye, int i) {
    return (ray_to_shadow[i] * vec4(from_eye, 1.0)).xyz;
}

// all that lies beyond a tile is lit, as its edge is
float sun_at_place(vec3 at, vec4 tile) {
    return textureLod(sun_shadow, vec3(clamp(at.xy, tile.xy, tile.zw), at.z), 0.0);
}

// where the first sun's map is asked: in the tile of the end that it shines on, if a point lies there
struct FirstPlace {
    vec3 at;
    vec2 scale;   // how much larger than in the other tile things are in this one
    vec4 tile;    // lookups stay within
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
    // the sun's disc spreads half vectors by half its radius (after Karis 2013, area lights)
    float alpha = m.roughness * m.roughness + 0.5 * sun_toward[i].w;
    float a2 = alpha * alpha;
    // Walter et al. 2007, eq. 33; Heitz 2014, eq. 99
    float d = fma(n_dot_h * n_dot_h, a2 - 1.0, 1.0);
    float distribution = a2 / (d * d);   // times pi, for sun_light is irradiance / pi
    float masking = 0.5 / (n_dot_l * sqrt(fma(n_dot_v * n_dot_v, 1.0 - a2, a2)) +
                           n_dot_v * sqrt(fma(n_dot_l * n_dot_l, 1.0 - a2, a2)) + 1e-5);
    float grazing = fresnel_climb(clamp(dot(r.view, half_way), 0.0, 1.0));
    vec3 metal = mix(m.albedo, vec3(1.0), grazing) * (1.0 + m.albedo * r.gain);
    float dielectric = mix(DIELECTRIC_F0, 1.0, grazing) * (1.0 + DIELECTRIC_F0 * r.gain);
    vec3 specular = mix(vec3(dielectric), metal, m.metallic) * (distribution * masking);
    return (r.diffuse + specular) * sun_light[i].rgb * n_dot_l;
}

// Percentage-closer filtering (Reeves et al. 1987) over the pixel's footprint, and no less than hides
// the map's texels; the first sun is the brightest, others have one lookup each. Not a matter of i in
// one function: it would be too large for Mesa to unroll the loop over suns.
float first_sun_share(vec3 from_eye, vec3 normal, float footprint_m) {
    FirstPlace place = first_place(from_eye);
    vec3 at = place.at;
    mat3 axes = transpose(mat3(ray_to_shadow[0]));   // the map's, in its units a metre
    axes[0] *= place.scale.x;
    axes[1] *= place.scale.y;
    vec3 squared = vec3(dot(axes[0], axes[0]), dot(axes[1], axes[1]), dot(axes[2], axes[2]));
    vec2 texels = SHADOW_TEXELS / vec2(textureSize(sun_shadow, 0));
    vec2 reach = max(texels, min(0.22 * footprint_m, 0.03) * sqrt(squared.xy));
    // slanted, so that each lookup has a row and a column of its own
    vec3 u = vec3(reach * vec2(0.75, 0.25), 0.0), v = vec3(reach * vec2(-0.25, 0.75), 0.0);
    // and on the plane of the surface
    vec3 plane = normal * axes / squared;
    vec2 slope = plane.xy / min(plane.z, -1e-3);
    u.z = -dot(slope, u.xy);
    v.z = -dot(slope, v.xy);
    return 0.25 * (sun_at_place(at + u, place.tile) + sun_at_place(at - u, place.tile) +
                   sun_at_place(at + v, place.tile) + sun_at_place(at - v, place.tile));
}

// Irradiance / pi, times the share of the hemisphere that hides the sky. What hides it is taken for a
// wall at right angles to the surface, facing where the open sky leans to, or walls all round where it
// leans nowhere; it is lit if the sun gets close to the point. Of what hangs above, a low sun lights sides
// that the surface does not see: fitted to rays below spreaders.
vec3 sun_thrown(vec3 from_eye, vec3 normal, Openness sky, int i) {
    vec3 toward = sun_toward[i].xyz;
    vec3 aside = leaning(sky, normal);
    float most = length(aside);
    float walled = length(toward - normal * dot(normal, toward)) / PI;
    float facing = mix(walled, max(dot(aside, toward), 0.0) / max(most, 1e-3),
                       smoothstep(0.0, 0.1, most));
    float lit = sun_at(from_eye + 0.02 * sky.direction, i);
    float seen = mix(1.0, clamp(3.0 * dot(normal, toward), 0.0, 1.0), sky.hung);
    return sky.rim * sky.rim * facing * lit * seen * sun_light[i].rgb;
}
