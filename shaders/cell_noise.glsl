// vec4 cell_noise(vec2 cell): four independent numbers in 0..1 for a cell with whole coordinates.

// Hoskins 2014, Hash without Sine (MIT licence): hash42.
vec4 cell_noise(vec2 cell) {
    vec4 p = fract(cell.xyxy * vec4(0.1031, 0.1030, 0.0973, 0.1099));
    p += dot(p, p.wzxy + 33.33);
    return fract((p.xxyz + p.yzzw) * p.zywx);
}
