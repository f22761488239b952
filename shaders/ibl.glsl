// vec3 lit(Reflector r, Openness sky): radiance of the environment reflected toward the eye.

uniform sampler2DArray specular_light;   // GGX-prefiltered radiance, a layer a roughness, 1-texel border
uniform sampler2D irradiance_light;      // irradiance / pi, 1-texel border
uniform sampler2D background_light;      // radiance, x in its middle, 1-texel border

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
    vec2 uv = bordered(octahedral(to_environment(direction).yzx), background_size);
    return textureLod(background_light, uv, 0.0).rgb;
}

// What rays have found to reach a point: of what an unhidden sky gives, its share of the irradiance and
// of what the mirror shows; irradiance / pi and radiance in the mirror that surfaces add.
struct Traced {
    vec3 open;
    vec3 thrown;
    vec3 mirrored_open;
    vec3 mirrored_thrown;
    float known;   // 0 where no rays were cast
};

const Traced NO_RAYS = Traced(vec3(1.0), vec3(0.0), vec3(1.0), vec3(0.0), 0.0);

// what of the sky a point sees: a cone about its mean direction, the cosine of the cone's half-angle,
// its irradiance from there, relative to that of a whole sky about that direction, the share that is
// open about where it mirrors the eye's ray, whether `light` lacks what comes from what hides the sky,
// 1 or 0, how much of that hangs above as a spreader does, 0 to 1, irradiance / pi that the suns throw on what
// hides the sky and faces here, times its share, and the albedo of what hides it; where there are rays, they
// stand for all of this
struct Openness {
    vec3 direction;
    float rim;
    vec3 light;
    float mirrored;
    float bounces;
    float hung;
    vec3 sun;
    vec3 beside;
    Traced rays;
};

// along the surface, away from what hides the sky most; 0 where it is hidden all round alike
vec3 leaning(Openness sky, vec3 normal) {
    return sky.direction - normal * dot(normal, sky.direction);
}

// Light that gets here by way of what hides the sky: Jimenez et al. 2016, Practical Realtime
// Strategies for Accurate Indirect Occlusion, section 4. Path-traced containers have three quarters of
// their fit in corners, and more where little is hidden: that stands in the open itself.
vec3 bounced(Openness sky) {
    float share = 1.0 - sky.rim * sky.rim;
    vec3 a = 2.0404 * sky.beside - 0.3324;
    vec3 b = -4.7951 * sky.beside + 0.6417;
    vec3 c = 2.7552 * sky.beside + 0.6903;
    vec3 fit = clamp(((share * a + b) * share + c) * share, share, 1.0) - share;
    return min(fit * (0.75 + max(0.75 - 1.5 * sky.rim, 0.0)), 1.0 - share);
}

// Share of a lobe about `mirror` that meets open sky, by the cone and by what is open just where the
// mirror points. Fitted, as are the bend, the width and the lean of lobes below, to GGX lobes of 96
// rays from the pixels of 32 scenes; of much hidden by the distance to path-traced images.
float open_lobe(Openness sky, vec3 mirror, float roughness) {
    float within = smoothstep(0.58 * sky.rim - 0.55, 0.58 * sky.rim + 0.69 + 0.76 * roughness,
                              dot(mirror, sky.direction));
    within = mix(1.0, within, min(sky.rim / 0.3, 1.0));   // no rim, nothing that hides
    // a lobe at a roof under a spreader goes by one gap or none
    float pointed = 0.22 + 0.32 * sky.rim + 0.4 * smoothstep(0.6, 0.9, sky.rim);
    return mix(within, sky.mirrored, pointed);
}

vec3 lit(Reflector r, Openness sky) {
    Material m = r.material;
    vec3 metal = (m.albedo * r.dfg.x + r.dfg.y) * (1.0 + m.albedo * r.gain);
    vec3 specular = mix(vec3(r.dielectric), metal, m.metallic);

    // rough lobes bend to the normal (Lagarde and de Rousiers 2014, section 4.9.3) and are narrower
    // from aslant
    float aslant = 1.0 - r.n_dot_v;
    float bend = min(m.roughness * m.roughness * (1.47 * m.roughness - 0.54 + 0.39 * aslant), 1.0);
    vec3 mirror = normalize(mix(reflect(-r.view, r.normal), r.normal, bend));
    float width = m.roughness * (1.025 - (0.79 - 0.415 * m.roughness) * aslant);
    vec3 around = diffuse_radiance(sky.direction) * (sky.light + sky.bounces * bounced(sky));
    around += sky.sun * mix(sky.beside, material_base[SHEET_MATERIAL].rgb, 0.5);
    // where the sky is hidden the mirror shows what hides it; the rest of a lobe leans away from there
    float open = open_lobe(sky, mirror, m.roughness);
    vec3 aside = leaning(sky, r.normal);
    float most = length(aside);
    float lean = 1.12 * m.roughness * (1.0 - open) * smoothstep(0.0, 0.2, most) / max(most, 1e-3);
    vec3 mirrored = mix(sky.beside * around, prefiltered(fma(vec3(lean), aside, mirror), width), open);
    if (sky.rays.known > 0.0) {
        around = diffuse_radiance(r.normal) * sky.rays.open + sky.rays.thrown;
        mirrored = prefiltered(mirror, width) * sky.rays.mirrored_open + sky.rays.mirrored_thrown;
    }
    return r.diffuse * around + specular * mirrored;
}
