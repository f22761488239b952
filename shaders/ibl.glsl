// vec3 lit(Reflector r, Openness sky): radiance of the environment reflected toward the eye.

uniform sampler2DArray specular_light;   // GGX-prefiltered radiance, a layer a roughness, 1-texel border
uniform sampler2D irradiance_light;      // irradiance / pi, 1-texel border
uniform sampler2D background_light;      // radiance, 1-texel border

vec3 to_environment(vec3 d) {
    return vec3(fma(yaw.x, d.x, yaw.y * d.y), fma(yaw.x, d.y, -yaw.y * d.x), d.z);
}

// inside the border of a map that is `size` texels wide
vec2 bordered(vec2 uv, float size) {
    float texel = 1.0 / size;
    return fma(uv, vec2(1.0 - 2.0 * texel), vec2(texel));
}

vec3 prefiltered(vec3 direction, float roughness) {
    vec2 uv = bordered(octahedral(to_environment(direction)), SPECULAR_SIZE);
    float layer = specular_layer(roughness);
    float below = floor(layer);
    vec3 a = textureLod(specular_light, vec3(uv, below), 0.0).rgb;
    vec3 b = textureLod(specular_light, vec3(uv, min(below + 1.0, SPECULAR_LAYERS - 1.0)), 0.0).rgb;
    return mix(a, b, layer - below);
}

vec3 diffuse_radiance(vec3 normal) {
    vec2 uv = bordered(octahedral(to_environment(normal)), IRRADIANCE_SIZE);
    return textureLod(irradiance_light, uv, 0.0).rgb;
}

// the direction may have any length
vec3 background(vec3 direction) {
    vec2 uv = bordered(octahedral(to_environment(direction)), background_size);
    return textureLod(background_light, uv, 0.0).rgb;
}

// what of the sky a point sees: a cone about its mean direction, the cosine of the cone's half-angle,
// its irradiance from there, relative to that of a whole sky about that direction, the share that is
// open about where it mirrors the eye's ray, whether `light` lacks what comes from what hides the sky,
// 1 or 0, and irradiance / pi that the suns throw on what hides it and faces here, times its share
struct Openness {
    vec3 direction;
    float rim;
    vec3 light;
    float mirrored;
    float bounces;
    vec3 sun;
};

// along the surface, away from what hides the sky most; 0 where it is hidden all round alike
vec3 leaning(Openness sky, vec3 normal) {
    return sky.direction - normal * dot(normal, sky.direction);
}

// Light that gets here by way of what hides the sky, which is taken for the same paint: Jimenez et
// al. 2016, Practical Realtime Strategies for Accurate Indirect Occlusion, section 4. Three
// quarters of their fit come nearest to path-traced containers.
vec3 bounced(Openness sky, vec3 albedo) {
    float share = 1.0 - sky.rim * sky.rim;
    vec3 a = 2.0404 * albedo - 0.3324;
    vec3 b = -4.7951 * albedo + 0.6417;
    vec3 c = 2.7552 * albedo + 0.6903;
    return 0.75 * (clamp(((share * a + b) * share + c) * share, share, 1.0) - share);
}

// Share of a lobe about `mirror` that meets open sky. Within a cone it is fitted to sampled GGX lobes
// over random roughness, view and cones within the hemisphere; the more is hidden, the less is what is
// open a cone, and the more it is asked for just where the mirror points.
float open_lobe(Openness sky, vec3 mirror, float roughness) {
    float within = smoothstep(sky.rim - 0.03 - 0.64 * roughness, sky.rim - 0.13 + 1.4 * roughness,
                              dot(mirror, sky.direction));
    return mix(within, sky.mirrored, sky.rim);
}

vec3 lit(Reflector r, Openness sky) {
    Material m = r.material;
    vec3 metal = (m.albedo * r.dfg.x + r.dfg.y) * (1.0 + m.albedo * r.gain);
    vec3 specular = mix(vec3(r.dielectric), metal, m.metallic);

    // rough lobes lean to the normal (Lagarde and de Rousiers 2014, section 4.9.3) and are narrower
    // from aslant; both fitted to the mean of directions of sampled GGX lobes
    vec3 mirror = reflect(-r.view, r.normal);
    mirror = normalize(mix(mirror, r.normal, m.roughness * m.roughness * m.roughness));
    float width = m.roughness * (1.0 - (0.65 - 0.71 * m.roughness) * (1.0 - r.n_dot_v));
    vec3 around = diffuse_radiance(sky.direction) * (sky.light + sky.bounces * bounced(sky, m.albedo));
    around += sky.sun * mix(m.albedo, material_base[SHEET_MATERIAL].rgb, 0.5);
    // where the sky is hidden the mirror shows the paint that hides it; what is left of a lobe leans
    // away from there and is narrower, by how much path-traced containers tell
    float open = open_lobe(sky, mirror, m.roughness);
    vec3 aside = leaning(sky, r.normal);
    float most = length(aside);
    float lean = 1.5 * m.roughness * (1.0 - open) * smoothstep(0.0, 0.2, most) / max(most, 1e-3);
    vec3 mirrored = mix(m.albedo * around,
                        prefiltered(fma(vec3(lean), aside, mirror), width * mix(0.7, 1.0, open)), open);
    return r.diffuse * around + specular * mirrored;
}
