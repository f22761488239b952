// Boxes of the containers and props on the ground, turned about z; first BOXES containers, then props.
// vec3 in_body(vec3 v, int i): a world vector in the axes of body i.
// float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m): share of a distant disc
// that body i hides.
// float body_cover(...; out int face): also the index into face_radiance of the side in front.
// BodyHit body_hit(vec3 from, vec3 ray, int i): where a ray enters a body.

#include "ground.constants"
#include "ground.block"

struct BodyHit {
    float depth;   // In lengths of the ray; infinite for a miss.
    vec3 normal;
};

vec3 in_body(vec3 v, int i) {
    float c = body_center[i].w, s = body_half[i].w;
    return vec3(fma(c, v.x, s * v.y), fma(c, v.y, -s * v.x), v.z);
}

vec3 reciprocal(vec3 v) {
    return 1.0 / mix(v, vec3(1e-6), lessThan(abs(v), vec3(1e-6)));
}

// The silhouette counts as one straight edge, along which a ray enters and leaves the body at once.
// from: World position in m. toward: Unit vector to the middle of the disc.
// spread: Angular radius of the disc. blur_m: Further radius, which filters the edge.
float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m, out int face) {
    vec3 turned = in_body(toward, i);
    vec3 inverse = reciprocal(turned);
    vec3 middle = -in_body(from - body_center[i].xyz, i) * inverse;
    vec3 width = body_half[i].xyz * abs(inverse);
    vec3 enter = middle - width, leave = middle + width, squared = inverse * inverse;
    float near = max(enter.x, max(enter.y, enter.z)), far = min(leave.x, min(leave.y, leave.z));
    float slopes = (near == enter.x ? squared.x : near == enter.y ? squared.y : squared.z) +
                   (far == leave.x ? squared.x : far == leave.y ? squared.y : squared.z);
    float along_x = step(enter.y, enter.x);
    face = along_x > 0.5 ? (turned.x > 0.0 ? 0 : 1) : (turned.y > 0.0 ? 2 : 3);
    near = max(near, 0.0);
    float inside = (far - near) * inversesqrt(slopes);
    float radius = fma(0.5 * (near + max(far, 0.0)), spread, blur_m);
    float x = clamp(inside / radius, -1.0, 1.0), q = x * x;
    // Share of a disc behind a line, fitted within 0.01.
    return fma(x, fma(q, fma(q, -0.1134, -0.0232), 0.6366), 0.5);
}

float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m) {
    int face;
    return body_cover(from, toward, i, spread, blur_m, face);
}

#if GROUND_PROPS
// A cylinder's axis is its y axis. body_paint.w is above 1 for cylinders.
BodyHit body_hit(vec3 from, vec3 ray, int i) {
    vec3 o = in_body(from - body_center[i].xyz, i), d = in_body(ray, i), size = body_half[i].xyz;
    vec3 inverse = reciprocal(d);
    vec3 middle = -o * inverse, width = size * abs(inverse);
    vec3 enter = middle - width, leave = middle + width;
    bool round_side = body_paint[i].w > 1.0;
    if (round_side) {
        // The distance from the axis, times the length across it, needs no cancelling terms.
        float length2 = max(dot(d.xz, d.xz), 1e-12), aside = o.x * d.z - o.z * d.x;
        float chord2 = fma(size.x * size.x, length2, -aside * aside);
        float half_chord = sqrt(max(chord2, 0.0)) / length2;
        float center = -dot(o.xz, d.xz) / length2;
        enter.x = enter.z = chord2 > 0.0 ? center - half_chord : 1e9;
        leave.x = leave.z = center + half_chord;
    }
    float near = max(enter.x, max(enter.y, enter.z)), far = min(leave.x, min(leave.y, leave.z));
    vec3 at = fma(vec3(near), d, o);
    vec3 n = near == enter.y ? vec3(0.0, -sign(d.y), 0.0)
           : round_side ? vec3(at.x, 0.0, at.z) / size.x
           : near == enter.x ? vec3(-sign(d.x), 0.0, 0.0) : vec3(0.0, 0.0, -sign(d.z));
    float c = body_center[i].w, s = body_half[i].w;
    vec3 normal = vec3(c * n.x - s * n.y, s * n.x + c * n.y, n.z);
    return BodyHit(near < far && near > 0.0 ? near : NO_DEPTH, normal);
}
#endif
