// What may hide the sky, seen in parallel from one direction: fastgen/light/sky_probe.py.
#version 430 core

layout(location = 0) in vec3 in_position_mm;

uniform mat4 to_map;

void main() { gl_Position = to_map * vec4(in_position_mm, 1.0); }
