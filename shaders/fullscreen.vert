// Vertex stage: one triangle that covers the viewport at the depth of the sky. Reads no buffers.
#version 430 core
#include "units.constants"

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, SKY_DEPTH, 1.0);
}
