// vec3 background(vec3 ray): mean radiance of the environment over the pixel around a view ray.
// vec3 diffuse_radiance(vec3 normal): irradiance / pi of the whole environment on a surface.
// vec3 prefiltered(vec3 direction, float roughness): its radiance, filtered by a GGX lobe.
// Directions are in the world frame. fastgen/light/prefilter.py makes the maps.

#include "environment.constants"
#include "samples.constants"
#include "scene.block"
#include "view.block"
#include "octahedral.glsl"

uniform sampler2DArray specular_map;   // GGX-prefiltered radiance, one layer per roughness.
uniform sampler2D irradiance_map;      // Irradiance / pi by surface normal.
uniform sampler2D environment_map;     // Radiance; +x is the middle of the map.

// World to environment frame; yaw: cosine and sine of the environment's rotation about +z.
vec3 to_environment(vec3 d) {
    return vec3(fma(yaw.x, d.x, yaw.y * d.y), fma(yaw.x, d.y, -yaw.y * d.x), d.z);
}

// Texture coordinates inside the border of one texel of a map `size` texels wide.
vec2 bordered(vec2 uv, float size) {
    float texel = 1.0 / size;
    return fma(uv, vec2(1.0 - 2.0 * texel), vec2(texel));
}

vec3 prefiltered(vec3 direction, float roughness) {
    vec2 uv = bordered(octahedral(to_environment(direction)), SPECULAR_SIZE);
    float layer = SPECULAR_LAYER(roughness);
    float below = floor(layer);
    vec3 a = textureLod(specular_map, vec3(uv, below), 0.0).rgb;
    vec3 b = textureLod(specular_map, vec3(uv, min(below + 1.0, SPECULAR_LAYERS - 1.0)), 0.0).rgb;
    return mix(a, b, layer - below);
}

vec3 diffuse_radiance(vec3 normal) {
    vec2 uv = bordered(octahedral(to_environment(normal)), IRRADIANCE_SIZE);
    return textureLod(irradiance_map, uv, 0.0).rgb;
}

vec3 background_at(vec3 direction) {
    vec2 uv = bordered(octahedral(to_environment(direction).yzx), background_size);
    return textureLod(environment_map, uv, 0.0).rgb;
}

vec3 background(vec3 ray) {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < SKY_SAMPLES; ++i)
        sum += background_at(ray + SKY_PLACE[i].x * ray_right + SKY_PLACE[i].y * ray_down);
    return sum / float(SKY_SAMPLES);
}
