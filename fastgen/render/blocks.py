"""Uniform blocks that the shaders read: of the scene, the view, the damages and the ground.

A shader declares a block with `#include "NAME.block"`.
"""

from collections.abc import Mapping

from fastgen.geometry.mesh import MATERIALS
from fastgen.light.directional_lights import MAX_LIGHTS
from fastgen.render.noise import NOISE_LEVELS
from fastgen.render.uniforms import Block
from fastgen.scene.limits import MAX_DAMAGES, MAX_FORMS, MAX_NEIGHBOURS, MAX_PROPS

SCENE_BLOCK = Block(
    "SceneBlock",
    0,
    (
        ("vec4", "material_base", len(MATERIALS)),  # albedo, roughness
        ("vec4", "material_trait", len(MATERIALS)),  # metallic, rust proneness, layers, unused
        ("vec4", "noise_lost", 2 * NOISE_LEVELS),  # NoiseTiles.lost_deviation
        ("vec3", "dirt_albedo"),
        ("float", "dirt_strength"),
        ("vec3", "rust_albedo"),
        ("float", "rust_roughness"),
        ("vec2", "noise_offset_mm"),
        ("float", "tone_variation"),
        ("float", "ageing_strength"),
        ("float", "ageing_reach_mm"),
        ("float", "dirt_reach_mm"),
        ("float", "rust_rate"),  # see rust.rate_of
        ("float", "rust_tile_mm"),
        ("float", "scratch_coverage"),
        ("float", "scrape_share"),
        ("float", "dirt_streaks"),
        ("float", "bleach"),
        ("float", "wear_strength"),
        ("float", "wear_tile_mm"),
        ("float", "wetness"),
        ("float", "background_size"),  # texels along a side of the environment map
        ("int", "container_id"),
        ("int", "first_seal_id"),
        ("int", "undamaged_value"),  # of the container in the damage image
        ("int", "decal_layers"),  # see DecalTables
        ("float", "decal_cell_mm"),
        ("float", "decal_margin_mm"),
        # radiance of the ground before the -x, +x, -y, +y, -z and +z side; 1 if there is one
        ("vec4", "side_ground_radiance", 6),
        ("vec4", "above"),  # albedo of the spreader above the container; 1 if there is one
    ),
)

VIEW_BLOCK = Block(
    "ViewBlock",
    1,
    (
        ("mat4", "world_to_clip"),  # without lens distortion, to the visibility buffer
        ("vec3", "ray_corner"),  # view ray of the image's upper left corner, depth 1
        ("float", "pixel_angle"),  # 1 / focal length in pixels
        ("vec3", "eye_m"),
        ("vec3", "ray_right"),  # change of the view ray per pixel to the right
        ("float", "exposure"),
        ("vec3", "ray_down"),
        ("vec2", "yaw"),  # cosine and sine of the environment's rotation
        ("int", "point_step"),  # pixels between the points from which rays are cast
        ("vec4", "lens_radial"),
        ("vec4", "lens_inverse", 2),  # polynomial of the inverse distortion
        ("vec2", "lens_tangential"),
        ("int", "lens_steps"),  # of the inverse, for tangential distortion
        ("vec4", "lens_to_clip"),  # columns of the matrix from the image plane to clip space
        ("vec2", "lens_clip_center"),  # principal point in clip space
        ("vec2", "lens_center"),
        ("vec2", "lens_linear_from"),  # radius beyond which the distortion is linear, slope there
        ("vec2", "lens_focal"),
        ("float", "lens_model"),  # 0 none, 1 Brown-Conrady, 2 fisheye
        ("mat4", "ray_to_shadow", MAX_LIGHTS),  # vector from the eye in m to (u, v, depth)
        ("vec4", "shadow_tile", MAX_LIGHTS),  # (u, v) of the first and the last texel of its tile
        # the first light has a finer tile for the end of the container that it shines on
        ("vec4", "shadow_end_transform"),  # from the coarse tile to the fine one: scale, offset
        ("vec4", "shadow_end_bounds"),  # least and greatest (u, v) to look up in the fine tile
        ("vec2", "shadow_end_plane"),  # sign along x; x from the eye in m where the tile begins
        ("vec4", "light_direction", MAX_LIGHTS),  # unit vector toward it; angular radius
        ("vec4", "light_irradiance", MAX_LIGHTS),  # irradiance / pi on a surface that faces it
        ("int", "light_count"),
    ),
)

DAMAGE_BLOCK = Block(
    "DamageBlock",
    2,
    (
        ("vec4", "damage_origin", MAX_DAMAGES),  # position; squared reach
        ("vec4", "damage_along", MAX_DAMAGES),  # axis; half length
        ("vec4", "damage_across", MAX_DAMAGES),  # axis; half width
        ("vec4", "damage_inward", MAX_DAMAGES),  # axis; depth
        ("vec4", "damage_shape", 3 * MAX_DAMAGES),  # Damage.shape, up to 11 numbers; fresh
        ("vec4", "damage_reach", MAX_DAMAGES),  # along, across, inward; mask value
        ("vec4", "damage_bare", MAX_DAMAGES),  # Damage.bare_albedo; paint_loss
        ("int", "damage_count"),
        # damages are sorted by form, in the order of damage_kinds.forms_of
        *(("int", f"form_{number}_end") for number in range(MAX_FORMS)),
        ("int", "hole_count"),
        ("float", "damage_threshold_mm"),
        ("int", "inner_row"),  # first row of the interior in the visibility buffer
    ),
)

MAX_BOXES = 1 + MAX_NEIGHBOURS
"""Containers around which the ground is drawn."""

GROUND_BLOCK = Block(
    "GroundBlock",
    3,
    (
        # boxes of the containers, then from MAX_BOXES the props
        ("vec4", "body_center", MAX_BOXES + MAX_PROPS),  # in m; cosine of its turn
        ("vec4", "body_half", MAX_BOXES + MAX_PROPS),  # half of its size in m; sine of its turn
        # albedo; for containers the height in m of the gap below, for props CYLINDER or 0
        ("vec4", "body_paint", MAX_BOXES + MAX_PROPS),
        # reciprocal of the unit vector to the first light, in the axes of each body
        ("vec4", "body_light", MAX_BOXES + MAX_PROPS),
        ("vec4", "face_radiance", 4 * MAX_BOXES),  # of the -x, +x, -y and +y side of each box
        ("vec4", "grid_transform"),  # scale and offset from world m to the grid's coordinates
        ("vec3", "ground_albedo"),
        ("float", "ground_height_m"),
        ("vec3", "line_albedo"),
        ("float", "ground_reach_m"),
        ("vec3", "ground_mean_albedo"),  # with lines and damp areas
        ("float", "slab_mm"),
        ("vec2", "line_direction"),
        ("vec2", "ground_noise_mm"),
        ("float", "line_spacing_mm"),
        ("float", "ground_wear"),
        # thresholds on uniform or normal noise
        ("float", "line_threshold"),
        ("float", "stain_threshold"),
        ("float", "damp_threshold"),
        ("float", "puddle_threshold"),
        ("float", "ground_clear_m"),
        ("int", "box_count"),  # containers
    ),
)

BLOCKS: Mapping[str, Block] = {
    "scene": SCENE_BLOCK,
    "view": VIEW_BLOCK,
    "damage": DAMAGE_BLOCK,
    "ground": GROUND_BLOCK,
}
"""The blocks by the name that shaders include."""
