// float multiple_scattering_gain(vec2 dfg): energy that single scattering on a rough surface loses, per
// unit of F0. dfg: Scale and bias of F0 in the split sum.
// Turquin 2019, Practical multiple scattering compensation for microfacet models, eq. 16.

float multiple_scattering_gain(vec2 dfg) { return 1.0 / (dfg.x + dfg.y) - 1.0; }
