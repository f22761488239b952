// Traced traced_at(...): light that rays have found at the points of light_points.frag about a place.

uniform usampler2D point_keys;
uniform sampler2D point_places;
uniform sampler2DArray point_light;   // as traced_light.py has it

// of points on the same surface, by how near they are; known: their weight, 0 for none
Traced traced_at(vec2 place, uint key, vec3 from_eye, vec3 normal) {
    vec2 at = (place - 0.5 - float(point_step / 2)) / float(point_step);   // in cells, from their points
    ivec2 nearest = ivec2(round(at));
    ivec2 cells = textureSize(point_keys, 0) / ivec2(1, 2);
    Traced mean = Traced(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    for (int i = 0; i < 18; ++i) {
        ivec2 cell = nearest + ivec2(i % 3, i / 3 % 3) - 1;
        // as much of each of a tile's four sets of rays
        vec2 near = clamp(1.5 - abs(vec2(cell) - at), 0.0, 1.0);
        cell = abs(cell);   // as in a mirror at the borders: a cell's parity tells its set
        cell = max(min(cell, 2 * (cells - 1) - cell), 0);
        if (i >= 9) cell.y += cells.y;
        vec3 apart = texelFetch(point_places, cell, 0).xyz - from_eye;
        // waves of sheets are 20 mm deep and more; damaged ones bend
        float off = WITH_DAMAGE == 1 ? fma(0.15, length(apart), 0.005) : 0.005;
        bool same = texelFetch(point_keys, cell, 0).r == key && abs(dot(apart, normal)) < off;
        if (!same) continue;
        float weight = near.x * near.y;
        mean.open += weight * texelFetch(point_light, ivec3(cell, 0), 0).rgb;
        mean.thrown += weight * texelFetch(point_light, ivec3(cell, 1), 0).rgb;
        mean.mirrored_open += weight * texelFetch(point_light, ivec3(cell, 2), 0).rgb;
        mean.mirrored_thrown += weight * texelFetch(point_light, ivec3(cell, 3), 0).rgb;
        mean.known += weight;
    }
    float share = 1.0 / max(mean.known, 1e-6);
    mean.open *= share;
    mean.thrown *= share;
    mean.mirrored_open *= share;
    mean.mirrored_thrown *= share;
    return mean;
}
