// The energy that single scattering loses does not come back.

float multiple_scattering_gain(vec2 dfg) { return 0.0; }
