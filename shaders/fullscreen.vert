// One triangle that covers the image, at the depth of one pixel class.
#version 430 core

uniform float class_depth = 0.0;

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, class_depth * 2.0 - 1.0, 1.0);
}
