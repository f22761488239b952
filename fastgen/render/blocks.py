"""Uniform blocks that the shaders read: one of the scene, one of the view, one of the damages.

A shader declares a block with `#include "NAME.block"`.
"""

from collections.abc import Mapping

from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.spreader_parts import CABLES
from fastgen.light.directional_lights import MAX_LIGHTS
from fastgen.render.noise import NOISE_LEVELS
from fastgen.render.uniforms import Block
from fastgen.scene.limits import MAX_DAMAGES

SCENE_BLOCK = Block(
    "SceneBlock",
    0,
    (
        ("vec4", "material_base", len(MATERIALS)),
        ("vec4", "material_trait", len(MATERIALS)),
        ("vec4", "noise_lost", 2 * NOISE_LEVELS),
        ("vec3", "dirt_albedo"),
        ("float", "dirt_strength"),
        ("vec3", "rust_albedo"),
        ("float", "rust_roughness"),
        ("vec2", "noise_offset_mm"),
        ("float", "tone_variation"),
        ("float", "ageing_strength"),
        ("float", "ageing_reach_mm"),
        ("float", "dirt_reach_mm"),
        ("float", "rust_coverage"),
        ("float", "rust_tile_mm"),
        ("float", "scratch_coverage"),
        ("float", "wear_strength"),
        ("float", "wear_tile_mm"),
        ("float", "wetness"),
        ("float", "background_size"),
        ("vec4", "above"),  # albedo of what hangs above the container, and whether anything does
    ),
)

VIEW_BLOCK = Block(
    "ViewBlock",
    1,
    (
        ("mat4", "world_to_clip"),
        ("vec3", "ray_corner"),
        ("float", "pixel_angle"),
        ("vec3", "eye_m"),
        ("vec3", "ray_right"),
        ("float", "exposure"),
        ("vec3", "ray_down"),
        ("vec2", "yaw"),
        ("int", "point_step"),  # pixels between points that rays are cast from
        ("vec4", "lens_radial"),
        ("vec4", "lens_back", 2),
        ("vec2", "lens_tangential"),
        ("vec4", "lens_to_clip"),  # columns of the matrix that takes the image plane there
        ("vec2", "lens_center"),
        ("vec2", "lens_end"),  # where its formula ends, and the slope there
        ("float", "lens_focal"),
        ("float", "lens_model"),  # 0 none, 1 Brown-Conrady, 2 fisheye
        ("mat4", "ray_to_shadow", MAX_LIGHTS),  # vector from the eye in m to (u, v, depth)
        ("vec4", "sun_tile", MAX_LIGHTS),  # the part of the map that is its own, centres of texels
        ("vec4", "to_end_tile"),  # from a place in the first sun's tile: scale, offset
        ("vec4", "end_tile"),  # from and up to where it is asked for the end that it shines on:
        ("vec2", "end_from"),  # toward 1 or -1 along x, and that much farther than the eye, in m
        ("vec4", "sun_toward", MAX_LIGHTS),  # unit vector to it, angular radius
        ("vec4", "sun_light", MAX_LIGHTS),  # irradiance / pi on what faces it
        ("int", "sun_count"),
        ("float", "cable_zone"),
        ("vec4", "cable_rusted"),  # mean albedo under rust, and its share
        ("vec4", "cable_foot", CABLES),  # lower end, from the eye in m; pixels a unit of `aside`
    ),
)

DAMAGE_BLOCK = Block(
    "DamageBlock",
    2,
    (
        ("vec4", "damage_origin", MAX_DAMAGES),  # position, squared reach
        ("vec4", "damage_along", MAX_DAMAGES),  # axis, half length
        ("vec4", "damage_across", MAX_DAMAGES),  # axis, half width
        ("vec4", "damage_inward", MAX_DAMAGES),  # axis, depth
        ("vec4", "damage_shape", 3 * MAX_DAMAGES),  # Damage.shape, and last the mask value
        ("int", "damage_count"),
        ("int", "hole_count"),  # perforations come first,
        ("int", "dent_end"),  # then dents up to here,
        ("int", "bowl_end"),  # and what is concave; bent edges are the rest
        ("float", "damage_threshold_mm"),
        ("int", "inner_row"),  # first row of the inner view in the sample targets
    ),
)


BLOCKS: Mapping[str, Block] = {"scene": SCENE_BLOCK, "view": VIEW_BLOCK, "damage": DAMAGE_BLOCK}
"""The blocks by the name that shaders include."""
