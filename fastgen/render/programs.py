"""Shader text: includes, the constants and uniform blocks that Python and GLSL share, programs."""

import itertools
import math
import re
from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.camera import tone
from fastgen.classes import CONTAINER_ID, SOUND_CONTAINER, SPREADER_ID
from fastgen.decals.artwork import ART_SIZE
from fastgen.geometry import damage_law
from fastgen.geometry.mesh import MATERIALS, MAX_ZONES
from fastgen.geometry.spreader_parts import CABLE_LENGTH_MM, CABLE_SIDE_MM, CABLES
from fastgen.light import environment
from fastgen.light.directional_lights import MOST_SUNS
from fastgen.light.reflectance import DIELECTRIC_F0, DIELECTRIC_INDEX
from fastgen.light.sky_visibility import LIGHT_STEPS, LIGHT_TIMES
from fastgen.render.glyph_runs import DEFINES as GLYPH_DEFINES
from fastgen.render.noise import NOISE_SIZE, NORMAL_REACH, noise_tiles
from fastgen.render.rust import DEFINES as RUST_DEFINES
from fastgen.render.sample_lattice import SampleLattice
from fastgen.render.uniforms import Block
from fastgen.resources import shader_path
from fastgen.scene.limits import DECAL_KINDS, MAX_DAMAGES, MIN_ROUGHNESS

LAYERS = (
    *("all", "base", "tone", "ageing", "dirt", "rust", "scratches", "decals", "reflection"),
    "normals",
)
"""What the shader can show; `ids` and `damage` of `fastgen show` are label targets."""

PIXEL_CLASSES = {
    "plain": (),
    "decal": ("DECALS",),
    "coarse": ("COARSE",),
    "mixed": ("MIXED",),
    "mixed_decal": ("MIXED", "DECALS"),
    "damaged": ("DECALS", "DAMAGE"),
    "mixed_damaged": ("MIXED", "DECALS", "DAMAGE"),
    "holed": ("MIXED", "DECALS", "DAMAGE", "HOLES"),
    "cable": (),
}
"""Pixels that see more than sky, by what is to be done there: several surfaces to filter, decals,
damage or holes near; those of two by two pixels that see one facet; cables that cover part of the
sky. Each class has a list, see shaders/classify.comp.
"""

PIXEL_TRAITS = ("MIXED", "DECALS", "COARSE", "DAMAGE", "HOLES")

COARSE_STEP_PX = 4.0
"""Pixels' widths over the sheet, by which pixels that are shaded at once lie apart at most: what is
seen more aslant, and what lies behind a step, is shaded by itself."""

SKY_DEPTH = 1 - 2**-18
"""Of clip space, over w: before 1, for clipping may round, and behind all nearer than 198 m."""

LIST_GROUP = 64
"""Pixels of a list that a compute work group takes."""

LIST_HEADER = 4
"""Numbers about a list ahead of all pixels: the three of its dispatch, and its length."""

LIST_BINDING = 0

SPREADER_ZONE = MAX_ZONES
"""The spreader's zones number from here on, the container's below."""

PORTAL_ZONE = 1000
"""Zone number of what a perforation tore away; real zones number below it."""

ZONE_TURN, ZONE_GEAR, ZONE_SMALL, ZONE_LEVEL = 16, 64, 128, 256
"""Of a zone's code (shaders/zone.glsl): steps of quarter turns above the material, and the bits of
gear, of small pieces and of what lies level."""

SHADOW_TEXELS = 1.0
"""Texels of the shadow map between lookups for the first sun, at least: with fewer, slanted edges
have teeth."""

DAMAGE_VARIANTS = ("sound", "damaged", "holed")
"""Programs for scenes without damage, with damage, and with a perforation among it."""

REACH_MARGIN_MM = 40.0
"""Pixels are filtered with their neighbours: this far around a damage they are shaded with it."""

OUT_OF_REACH_MM = 1e6
"""Rest position, along each axis, of what no damage touches."""

LOBE_CELLS = 32
"""Along each side of the octahedral maps of openness.lobe_masks."""

LOOKUP_PX = {1: 0.92, 2: 0.6, 25: 0.2}
"""Width of each of a pixel's lookups of the layers, by how many there are, where the pixel is
filtered as a square; a wider filter asks for wider ones. Found by the distance to path-traced
references."""

LOOKUP_PLACES = {
    1: ((0.0, 0.0),),
    2: ((0.25, 0.1), (-0.25, -0.1)),
    25: tuple(itertools.product((-0.4, -0.2, 0.0, 0.2, 0.4), repeat=2)),
}
"""Where in a pixel that sees one surface they are, in pixels from its centre."""

DECAL_CELL_MM = 64.0
NEAR_CELL_MM = 16.0  # of decals_near
GUTTER_STEPS = 17
"""Times that a part is laid on a baked atlas: itself, then shifted for two rings of texels."""

INSIDE_ALBEDO = {"wood": (0.22, 0.14, 0.08), "primer": (0.30, 0.31, 0.29)}
"""Linear albedo of what a hole shows: the floor, and all else."""

INSIDE_LIGHT = 0.1
"""Share of the light around that reaches the inside through a hole; chosen by eye."""

_NOISE_LEVELS = NOISE_SIZE.bit_length()

SCENE_BLOCK = Block(
    "SceneBlock",
    0,
    (
        ("vec4", "material_base", len(MATERIALS)),
        ("vec4", "material_trait", len(MATERIALS)),
        ("vec4", "noise_lost", 2 * _NOISE_LEVELS),
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
        ("mat4", "ray_to_shadow", MOST_SUNS),  # from the eye to a point in m, to a place in its map
        ("vec4", "sun_tile", MOST_SUNS),  # the part of the map that is its own, centres of texels
        ("vec4", "to_end_tile"),  # from a place in the first sun's tile: scale, offset
        ("vec4", "end_tile"),  # from and up to where it is asked for the end that it shines on:
        ("vec2", "end_from"),  # toward 1 or -1 along x, and that much farther than the eye, in m
        ("vec4", "sun_toward", MOST_SUNS),  # unit vector to it, angular radius
        ("vec4", "sun_light", MOST_SUNS),  # irradiance / pi on what faces it
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


def listed_classes(samples_per_axis: int) -> tuple[str, ...]:
    """The classes that pixels of so many samples may be of, in the order of their lists."""
    others = ("mixed",) if samples_per_axis == 1 else ("coarse",)
    return tuple(name for name in PIXEL_CLASSES if not name.startswith(others))


def noise_deviation() -> NDArray[np.float32]:
    """The table `noise_lost` of SCENE_BLOCK, float32 [2 * levels, 4]."""
    return noise_tiles().lost_deviation.reshape(-1, 4)


def _constants(
    samples_per_axis: int,
    lookups: int,
    layer: str,
    pixel_class: str,
    damage: str,
    suns: int,
    traced: bool,
    coarse: bool,
    cables: bool,
) -> str:
    levels = environment.ROUGHNESS_LEVELS
    steps = "".join(
        f" + clamp((roughness - {a:.6f}) / {b - a:.6f}, 0.0, 1.0)"
        for a, b in itertools.pairwise(levels)
    )
    lattice = SampleLattice(samples_per_axis)
    # prints are filtered by themselves and cost most, and damages share their classes: a second
    # lookup there gains little
    lookups = 1 if lookups == 2 and "DECALS" in PIXEL_CLASSES[pixel_class] else lookups
    lists = listed_classes(samples_per_axis)
    shown = {name: int(layer in ("all", "normals", "reflection", name)) for name in LAYERS}
    defines: dict[str, object] = {
        "MM": "0.001",
        "VOID_DEPTH": "uintBitsToFloat(0x7f800000u)",
        "SOUND_CONTAINER": f"{SOUND_CONTAINER}u",
        "CONTAINER_ID": f"{CONTAINER_ID}u",
        "SPREADER_ID": f"{SPREADER_ID}u",
        "SPREADER_ZONE": f"{SPREADER_ZONE}u",
        "MIN_ROUGHNESS": MIN_ROUGHNESS,
        "DIELECTRIC_F0": DIELECTRIC_F0,
        "DIELECTRIC_INDEX": DIELECTRIC_INDEX,
        "INSIDE_LIGHT": INSIDE_LIGHT,
        "TONE_FRESNEL": tone.FRESNEL,
        "TONE_SHOULDER": tone.SHOULDER,
        "TONE_DESATURATION": tone.DESATURATION,
        "LIGHT_STEPS": f"{LIGHT_STEPS:.1f}",
        "LIGHT_TIMES": f"{LIGHT_TIMES:.1f}",
        "LOBE_CELLS": LOBE_CELLS,
        **{f"INSIDE_{name.upper()}": f"vec3{rgb}" for name, rgb in INSIDE_ALBEDO.items()},
        "SPECULAR_SIZE": f"{environment.SPECULAR_SIZE:.1f}",
        "SPECULAR_LAYERS": f"{len(levels):.1f}",
        "IRRADIANCE_SIZE": f"{environment.IRRADIANCE_SIZE:.1f}",
        "NOISE_SIZE": f"{NOISE_SIZE:.1f}",
        "NORMAL_REACH": f"{NORMAL_REACH}",
        "SCRATCHED_SHARE": f"{noise_tiles().scratched:.6f}",
        "NOISE_LEVELS": f"{_NOISE_LEVELS:.1f}",
        "DECAL_CELL_MM": f"{DECAL_CELL_MM:.1f}",
        "NEAR_CELL_MM": f"{NEAR_CELL_MM:.1f}",
        "ART_SIZE": f"{ART_SIZE:.1f}",
        **GLYPH_DEFINES,
        **{f"DECAL_{name.upper()}": f"{value:.1f}" for name, value in DECAL_KINDS.items()},
        **{f"LAYER_{name.upper()}": i for i, name in enumerate(LAYERS)},
        **{f"SHOWN_{name.upper()}": value for name, value in shown.items()},
        **{f"LIST_{name.upper()}": f"{i}u" for i, name in enumerate(lists)},
        "LIST": f"LIST_{pixel_class.upper()}",
        "NO_LIST": f"{len(lists)}u",
        "LISTS": f"{len(lists)}u",
        "LIST_HEADER": f"{LIST_HEADER}u",
        **{f"WITH_{trait}": int(trait in PIXEL_CLASSES[pixel_class]) for trait in PIXEL_TRAITS},
        "GUTTER_STEPS": GUTTER_STEPS,
        "OUT_OF_REACH_MM": f"{OUT_OF_REACH_MM:g}",
        "LIST_GROUP": f"{LIST_GROUP}u",
        "LIST_BINDING": LIST_BINDING,
        "MAX_PARTS": 3,
        "MAX_SIDES": 4,
        "DAMAGED": int(damage != "sound"),
        "HOLED": int(damage == "holed"),
        "PI": f"{math.pi:.8f}",
        "DAMAGE_FADE_START_MM": f"{damage_law.FADE_START_MM:.1f}",
        "DAMAGE_FADE_END_MM": f"{damage_law.FADE_END_MM:.1f}",
        "REACH_MARGIN_MM": f"{REACH_MARGIN_MM:.1f}",
        "HOLE_REACH": f"{damage_law.HOLE_REACH:g}",
        "PORTAL_ZONE": f"{PORTAL_ZONE}u",
        "ZONE_MATERIAL": ZONE_TURN - 1,
        "ZONE_TURN": ZONE_TURN,
        "ZONE_GEAR": ZONE_GEAR,
        "ZONE_SMALL": ZONE_SMALL,
        "ZONE_LEVEL": ZONE_LEVEL,
        **RUST_DEFINES,
        "SUNS": suns,
        "TRACED": int(traced),
        "SHADOW_TEXELS": SHADOW_TEXELS,
        "SKY_DEPTH": SKY_DEPTH,
        "COARSE": int(coarse),
        "CABLES_NEAR": int(cables),
        "OF_CABLES": int(pixel_class == "cable"),
        "COARSE_STEP_PX": COARSE_STEP_PX,
        "CABLES": CABLES,
        "CABLE_LENGTH_M": f"{CABLE_LENGTH_MM / 1000:.6f}",
        "CABLE_HALF_SIDE_M": f"{CABLE_SIDE_MM / 2000:.6f}",
        "CABLE_MATERIAL": list(MATERIALS).index("cable"),
        "SHEET_MATERIAL": list(MATERIALS).index("paint_sheet"),
        "LAYER": LAYERS.index(layer),
        "SAMPLES_PER_AXIS": samples_per_axis,
        "SAMPLE_SLANT": lattice.slant,
        "SAMPLE_PAD": lattice.pad,
        "LOOKUPS": lookups,
        "FILTER_STEP": lattice.step,
        "LOOKUP_PX": LOOKUP_PX[lookups] * lattice.spread,
    }
    # lets the vertex stage send an instance to the inner view
    lines = ["#extension GL_ARB_shader_viewport_layer_array : enable"] if damage == "holed" else []
    lines += [f"#define {name} {value}" for name, value in defines.items()]
    lines.append(f"float specular_layer(float roughness) {{ return 0.0{steps}; }}")
    offsets = ", ".join(f"ivec2({x}, {y})" for x, y in lattice.filter)
    weights = ", ".join(f"{weight:.8f}" for weight in lattice.filter.values())
    places = ", ".join(
        f"vec2({lattice.spread * x:.8f}, {lattice.spread * y:.8f})"
        for x, y in LOOKUP_PLACES[lookups]
    )
    lines.append(f"const vec2 LOOKUP_PLACE[LOOKUPS] = vec2[LOOKUPS]({places});")
    lines.append(f"#define FILTER_NEAR {lattice.near}")
    lines.append(f"#define FILTER_SAMPLES {len(lattice.filter)}")
    lines.append(f"const ivec2 FILTER_OFFSET[FILTER_SAMPLES] = ivec2[FILTER_SAMPLES]({offsets});")
    lines.append(f"const float FILTER_WEIGHT[FILTER_SAMPLES] = float[FILTER_SAMPLES]({weights});")
    return "\n".join(lines) + "\n"


def expand(
    text: str,
    samples_per_axis: int = 1,
    lookups: int = 1,
    layer: str = "all",
    pixel_class: str = "plain",
    damage: str = "sound",
    suns: int = 0,
    traced: bool = False,
    coarse: bool = False,
    cables: bool = False,
) -> str:
    """Shader text with its includes filled in; `blocks.glsl` stands for the shared declarations.

    cables: whether pixels may see some.
    """

    def include(match: re.Match[str]) -> str:
        if match[1] == "blocks.glsl":
            constants = _constants(
                samples_per_axis, lookups, layer, pixel_class, damage, suns, traced, coarse, cables
            )
            blocks = [SCENE_BLOCK, VIEW_BLOCK] + [DAMAGE_BLOCK] * (damage != "sound")
            return constants + "".join(block.glsl() for block in blocks)
        return included(shader_path(match[1]).read_text(encoding="utf-8"))

    def included(part: str) -> str:
        return re.sub(r'#include "([^"]+)"\n', include, part)

    text = included(text)
    version = re.search(r"#version .*\n", text)
    assert version, "a shader needs a #version line"
    return version[0] + text.replace(version[0], "", 1)


def link(
    ctx: moderngl.Context, vertex: str, fragment: str, samplers: Mapping[str, int], **variant: Any
) -> moderngl.Program:
    """Compile and link two shader files; samplers: texture unit of each sampler uniform."""
    program = ctx.program(
        vertex_shader=expand(shader_path(vertex).read_text(encoding="utf-8"), **variant),
        fragment_shader=expand(shader_path(fragment).read_text(encoding="utf-8"), **variant),
    )
    _assign(program, samplers)
    return program


def link_compute(
    ctx: moderngl.Context, compute: str, samplers: Mapping[str, int], **variant: Any
) -> moderngl.ComputeShader:
    """Compile and link a compute shader file; samplers: as for `link`."""
    program = ctx.compute_shader(
        expand(shader_path(compute).read_text(encoding="utf-8"), **variant)
    )
    _assign(program, samplers)
    return program


def _assign(
    program: moderngl.Program | moderngl.ComputeShader, samplers: Mapping[str, int]
) -> None:
    for name, unit in samplers.items():
        if name in program:
            program[name] = unit
