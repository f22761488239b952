// Twin of fastgen/camera/lens.py.
// vec4 lens_distorted(vec4 clip): clip position after the lens distortion.
// vec2 undistorted(vec2 pixel): undistorted position of a pixel of the image; inverse of lens_distorted().
// Brown-Conrady and fisheye (Kannala-Brandt) models with OpenCV's coefficients. Far outside the image
// the radial polynomial continues as a straight line.

#include "variant.constants"
#include "view.block"

// Tangential distortion of the Brown-Conrady model.
vec2 tangential(vec2 p) {
    float q = dot(p, p);
    vec2 twice = 2.0 * lens_tangential * p.x * p.y;
    return twice + lens_tangential.yx * (q + 2.0 * p * p);
}

vec4 lens_distorted(vec4 clip) {
    if (lens_model == 0.0) return clip;
    mat2 to_clip = mat2(lens_to_clip.xy, lens_to_clip.zw);
    vec2 ideal = inverse(to_clip) * (clip.xy - lens_clip_center * clip.w) / clip.w;
    float radius = max(length(ideal), 1e-6);
    float t = lens_model == 2.0 ? atan(radius) : radius;
    float inner = min(t, lens_linear_from.x);
    float q = inner * inner;
    float curve = 1.0 + q * (lens_radial.x + q * (lens_radial.y + q * (lens_radial.z + q * lens_radial.w)));
    float seen = inner * curve + lens_linear_from.y * (t - inner);
    vec2 moved = ideal * (seen / radius) + tangential(ideal * min(1.0, lens_linear_from.x / radius));
    return vec4(to_clip * moved * clip.w + lens_clip_center * clip.w, clip.zw);
}

// Ratio of the undistorted to the distorted radius: the reciprocal of a polynomial in the squared
// radius, which lens.py fits.
float undistortion_ratio(vec2 seen) {
    float q = dot(seen, seen);
    vec4 high = lens_inverse[1], low = lens_inverse[0];
    float ratio = ((high.w * q + high.z) * q + high.y) * q + high.x;
    return 1.0 / ((((ratio * q + low.w) * q + low.z) * q + low.y) * q + low.x);
}

// The tangential term depends on the undistorted point, which fixed-point iteration finds.
vec2 undistorted(vec2 pixel) {
#if LENS
    vec2 seen = (pixel - lens_center) / lens_focal;
    vec2 ideal = seen * undistortion_ratio(seen);
    int i = 0;
    do {
        vec2 radial = seen - tangential(ideal);
        ideal = radial * undistortion_ratio(radial);
    } while (++i < lens_steps);
    return lens_center + lens_focal * ideal;
#else
    return pixel;
#endif
}
