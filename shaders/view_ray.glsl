// vec3 view_ray(vec2 pixel): from the eye through a place in the image; a metre of depth long.

vec3 view_ray(vec2 pixel) {
    pixel = straightened(pixel);
    return fma(vec3(pixel.x), ray_right, fma(vec3(pixel.y), ray_down, ray_corner));
}
