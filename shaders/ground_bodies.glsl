// Boxes of the containers and props on the ground, turned about z. Containers are bodies 0 to
// box_count - 1; EACH_BOX(f) runs f(i) for each if GROUND_BOXES is set. Props follow from MAX_BOXES.
// vec3 in_body(vec3 v, int i): a world vector in the axes of body i.
// float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m): share of a distant disc
// that body i hides.
// float body_cover(...; out int face): also the index into face_radiance of the side in front, or 4 for
// the bottom or top.
// BodyHit body_hit(vec3 from, vec3 ray, int i): where a ray enters a body.

#include "ground.constants"
#include "units.constants"
#include "ground.block"

#if GROUND_BOXES
#define EACH_BOX(f) for (int box = 0; box < box_count; ++box) f(box)
#else
#define EACH_BOX(f)
#endif

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

// The silhouette counts as one straight line through an edge, along which a ray enters and leaves the
// body at once. A second line ends it at corners, where the shadow would otherwise run on. The line that
// hides less of the disc counts.
// offset: Position in the axes of the body, from its centre in m. half_size: Half of its size.
// inverse: Reciprocal of the unit vector to the middle of the disc, in the axes of the body.
// spread: Angular radius of the disc. blur_m: Further radius, which filters the edge.
// enter: Distances at which the ray passes the near plane of each axis.
float hidden_share(vec3 offset, vec3 half_size, vec3 inverse, float spread, float blur_m, out vec3 enter) {
    // Length of the ray per metre along each axis.
    vec3 per_axis = abs(inverse), squared = inverse * inverse;
    vec3 middle = -offset * inverse, width = half_size * per_axis, leave = middle + width;
    enter = middle - width;
    float near = max(enter.x, max(enter.y, enter.z)), far = min(leave.x, min(leave.y, leave.z));
    float at_near = near == enter.x ? squared.x : near == enter.y ? squared.y : squared.z;
    float at_far = far == leave.x ? squared.x : far == leave.y ? squared.y : squared.z;
    near = max(near, 0.0);
    float slopes = at_near + at_far, inside = (far - near) * inversesqrt(slopes);
    // Distance to the point of the ray that is nearest to the edge.
    float distance_m = max(fma(near, at_far, far * at_near) / slopes, 0.0);
    float radius = fma(distance_m, spread, blur_m);
    // The other line is the one that the body leaves last if it grows by the radius on all sides.
    vec3 first = fma(vec3(-radius), per_axis, enter), last = fma(vec3(radius), per_axis, leave);
    float start = max(first.x, max(first.y, first.z)), end = min(last.x, min(last.y, last.z));
    float at_start = start == first.x ? per_axis.x : start == first.y ? per_axis.y : per_axis.z;
    float at_end = end == last.x ? per_axis.x : end == last.y ? per_axis.y : per_axis.z;
    float other = fma(-radius, at_start + at_end, end - start) *
                  inversesqrt(fma(at_start, at_start, at_end * at_end));
    float x = clamp(min(inside, other) / radius, -1.0, 1.0), q = x * x;
    // Share of a disc behind a line, fitted within 0.01.
    return fma(x, fma(q, fma(q, -0.1134, -0.0232), 0.6366), 0.5);
}

// from: World position in m. toward: Unit vector to the middle of the disc.
float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m, out int face) {
    vec3 turned = in_body(toward, i), enter;
    float cover = hidden_share(in_body(from - body_center[i].xyz, i), body_half[i].xyz, reciprocal(turned),
                               spread, blur_m, enter);
    face = enter.z > max(enter.x, enter.y) ? 4
         : enter.x > enter.y ? (turned.x > 0.0 ? 0 : 1) : (turned.y > 0.0 ? 2 : 3);
    return cover;
}

float body_cover(vec3 from, vec3 toward, int i, float spread, float blur_m) {
    int face;
    return body_cover(from, toward, i, spread, blur_m, face);
}

#if GROUND_PROPS
// A cylinder's axis is its y axis. body_paint.w is CYLINDER for cylinders.
BodyHit body_hit(vec3 from, vec3 ray, int i) {
    vec3 o = in_body(from - body_center[i].xyz, i), d = in_body(ray, i), size = body_half[i].xyz;
    vec3 inverse = reciprocal(d);
    vec3 middle = -o * inverse, width = size * abs(inverse);
    vec3 enter = middle - width, leave = middle + width;
    bool round_side = body_paint[i].w == CYLINDER;
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
