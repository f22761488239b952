// float fresnel(float cosine, float index): Fresnel reflectance of a dielectric.
// float fresnel_climb(float cosine): that of paint and other dielectrics, rescaled from F0..1 to 0..1.
// Twin of fastgen/light/reflectance.py.

#include "reflectance.constants"

// Cook and Torrance 1982, A Reflectance Model for Computer Graphics.
float fresnel(float cosine, float index) {
    float g = sqrt(fma(cosine, cosine, index * index - 1.0));
    float away = (g - cosine) / (g + cosine);
    float ratio = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    return 0.5 * away * away * (1.0 + ratio * ratio);
}

float fresnel_climb(float cosine) {
    return (fresnel(cosine, DIELECTRIC_INDEX) - DIELECTRIC_F0) / (1.0 - DIELECTRIC_F0);
}
