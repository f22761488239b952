// Fragment stage of the occluders' depth maps: writes depth only.
#version 430 core

void main() {}
