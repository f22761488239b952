// Nothing but depth.
#version 430 core

void main() {}
