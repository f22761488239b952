// float ggx(float alpha, float n_dot_h, float n_dot_l, float n_dot_v): specular lobe of a rough surface
// without Fresnel reflectance, times pi. Multiplied by irradiance / pi it gives radiance.

// GGX distribution: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces, eq. 33.
// Masking and shadowing: Heitz 2014, Understanding the Masking-Shadowing Function, eq. 99.
float ggx(float alpha, float n_dot_h, float n_dot_l, float n_dot_v) {
    float a2 = alpha * alpha;
    float d = fma(n_dot_h * n_dot_h, a2 - 1.0, 1.0);
    float distribution = a2 / (d * d);
    float masking = 0.5 / (n_dot_l * sqrt(fma(n_dot_v * n_dot_v, 1.0 - a2, a2)) +
                           n_dot_v * sqrt(fma(n_dot_l * n_dot_l, 1.0 - a2, a2)) + 1e-5);
    return distribution * masking;
}
