// Vertex stage of the occluders' depth maps, for sky visibility and shadows of directional lights.
// Reads positions in mm and projects them in parallel; map_matrix in occluders.py makes to_map.
#version 430 core

layout(location = 0) in vec3 in_position_mm;

uniform mat4 to_map;

void main() { gl_Position = to_map * vec4(in_position_mm, 1.0); }
