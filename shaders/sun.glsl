// vec3 sunlit(Reflector r): radiance of the sun reflected toward the eye, unshadowed;
// float sun_share(vec3 from_eye, vec3 normal, float footprint_m): how much of it gets there, 0..1.

uniform sampler2DShadow sun_shadow;

vec3 sunlit(Reflector r) {
    Material m = r.material;
    float n_dot_v = max(r.n_dot_v, 1e-3);
    float n_dot_l = max(dot(r.normal, sun_direction), 0.0);
    vec3 half_way = normalize(r.view + sun_direction);
    float n_dot_h = max(dot(r.normal, half_way), 0.0);
    // the sun's disc spreads half vectors by half its radius (after Karis 2013, area lights)
    float alpha = m.roughness * m.roughness + 0.5 * sun_radius;
    float a2 = alpha * alpha;
    // Walter et al. 2007, eq. 33; Heitz 2014, eq. 99
    float d = fma(n_dot_h * n_dot_h, a2 - 1.0, 1.0);
    float distribution = a2 / (d * d);   // times pi, for sun_light is irradiance / pi
    float masking = 0.5 / (n_dot_l * sqrt(fma(n_dot_v * n_dot_v, 1.0 - a2, a2)) +
                           n_dot_v * sqrt(fma(n_dot_l * n_dot_l, 1.0 - a2, a2)) + 1e-5);
    float grazing = pow(1.0 - clamp(dot(r.view, half_way), 0.0, 1.0), 5.0);
    vec3 metal = mix(m.albedo, vec3(1.0), grazing) * (1.0 + m.albedo * r.gain);
    float dielectric = mix(DIELECTRIC_F0, 1.0, grazing) * (1.0 + DIELECTRIC_F0 * r.gain);
    vec3 specular = mix(vec3(dielectric), metal, m.metallic) * (distribution * masking);
    return (r.diffuse + specular) * sun_light * n_dot_l;
}

// Percentage-closer filtering (Reeves et al. 1987) over the pixel's footprint on the surface, and no
// less than a penumbra. from_eye: to the point, in m.
float sun_share(vec3 from_eye, vec3 normal, float footprint_m) {
    float reach = clamp(0.22 * footprint_m, 0.002, 0.03);
    vec3 along = normalize(abs(normal.z) < 0.7 ? vec3(-normal.y, normal.x, 0.0)
                                               : vec3(normal.z, 0.0, -normal.x));
    vec3 at = (ray_to_shadow * vec4(from_eye, 1.0)).xyz;
    vec3 u = mat3(ray_to_shadow) * (reach * along);
    vec3 v = mat3(ray_to_shadow) * (reach * cross(normal, along));
    return 0.25 * (textureLod(sun_shadow, at + u + v, 0.0) + textureLod(sun_shadow, at + u - v, 0.0) +
                   textureLod(sun_shadow, at - u + v, 0.0) + textureLod(sun_shadow, at - u - v, 0.0));
}
