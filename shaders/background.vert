// Vertex stage of the background: draws the octahedron from which the environment map is unfolded,
// around the camera. Reads no buffers; writes the map coordinates. They are linear on each face, so
// interpolation is exact and cheap.
#version 430 core
#include "units.constants"
#include "scene.block"
#include "view.block"

out vec2 map_uv;   // Inside the map's border.

void main() {
    int face = gl_VertexID / 3;
    vec3 toward = vec3(face & 1, (face >> 1) & 1, face >> 2) * 2.0 - 1.0;
    vec3 corner = vec3(0.0);
    corner[gl_VertexID % 3] = toward[gl_VertexID % 3];
    // The corner at -x unfolds to all four corners of the map; see octahedral.glsl.
    vec2 unfolded = corner.x < 0.0 ? toward.yz : corner.yz;
    float texel = 1.0 / background_size;
    map_uv = (unfolded * 0.5 + 0.5) * (1.0 - 2.0 * texel) + texel;

    vec3 world = vec3(yaw.x * corner.x - yaw.y * corner.y, yaw.x * corner.y + yaw.y * corner.x, corner.z);
    // The optical axis passes through the middle of the image.
    vec2 across = vec2(dot(world, ray_right), dot(world, ray_down));
    vec2 to_border = -vec2(dot(ray_corner, ray_right), dot(ray_corner, ray_down));
    float ahead = dot(world, normalize(cross(ray_right, ray_down)));
    gl_Position = vec4(across / to_border, SKY_DEPTH * ahead, ahead);
}
