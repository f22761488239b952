// No pixel shows a cable.

float cable_coverage(vec2 pixel) { return 0.0; }
