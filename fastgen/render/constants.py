"""Constants that shaders share with Python, in groups that a shader includes by name.

A shader declares what it needs with `#include "GROUP.constants"`. `constants_text` turns a group
into `#define` lines. Values belong to the Python module that owns them; this module only names
them for GLSL, and owns the few that no other module uses.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from fastgen.camera import tone_curve
from fastgen.classes import SPREADER_ID
from fastgen.damages import fields
from fastgen.decals.artwork import ART_SIZE
from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.seals import PARTS
from fastgen.light import environment, prop_light
from fastgen.light.ground_light import DAMP_SOFTNESS, DAMP_WETNESS, LINE_MM
from fastgen.light.reflectance import (
    DIELECTRIC_F0,
    DIELECTRIC_INDEX,
    POROUS_LOSS,
    WATER_F0,
    WATER_INDEX,
)
from fastgen.light.sky_visibility import LIGHT_STEPS, LIGHT_TIMES
from fastgen.render import glyph_runs, rust
from fastgen.render.blocks import MAX_BOXES
from fastgen.render.noise import NOISE_LEVELS, NOISE_SIZE, NORMAL_REACH, noise_tiles
from fastgen.render.sample_lattice import LOOKUP_PLACES, LOOKUP_PX, SKY_PLACES, SampleLattice
from fastgen.render.variant import (
    LAYERS,
    PIXEL_CLASSES,
    PIXEL_TRAITS,
    ShaderVariant,
)
from fastgen.render.zone_codes import (
    DECAL_SHEET,
    HOLE_ZONE,
    SEAL_ZONE,
    SHEET_NUMBERS,
    SPREADER_ZONE,
    ZONE_GEAR,
    ZONE_LEVEL,
    ZONE_SHEET,
    ZONE_SMALL,
    ZONE_TURN,
)
from fastgen.scene.damage_kinds import forms_of
from fastgen.scene.faces import CORRUGATED_ALONG_Y
from fastgen.scene.limits import DECAL_KINDS, GROUNDS, MIN_ROUGHNESS

LIST_GROUP = 64
"""Pixels that one compute work group shades."""

LIST_HEADER = 4
"""Numbers at the start of a pixel list: three of its indirect dispatch, then its length."""

LIST_BINDING = 0
"""Binding point of the storage buffer that holds the pixel lists."""

LOBE_CELLS = 32
"""Cells along each side of the octahedral maps of sky_visibility.lobe_masks."""

REACH_MARGIN_MM = 40.0
"""A pixel this near to a damage is shaded with it, because its filter reaches neighbours."""

DECAL_CELL_MM = 64.0
"""Side of a cell of the grid that names the decals covering a spot of the atlas."""

NEAR_CELL_MM = 16.0
"""Side of a cell of decals_near.decals_near."""

GUTTER_STEPS = 17
"""Instances of a part in a baked atlas: the part, then 16 shifts that fill two rings of texels."""

INSIDE_ALBEDO = {"wood": (0.22, 0.14, 0.08), "primer": (0.30, 0.31, 0.29)}
"""Linear albedo of the container's interior: the floor, and all other sides."""

_INSIDE_LIGHT = 0.1
"""Share of the light outside that reaches the interior through a hole; an artistic choice."""

_SKY_DEPTH = 1 - 2**-18
"""Clip-space depth of the background over w: below 1 because clipping may round, and behind
everything nearer than 198 m."""

CYLINDER = 2.0
"""Value in body_paint of GROUND_BLOCK that marks a prop as a cylinder."""

GROUND_FILTER_PX = 0.35
"""Radius in pixels over which ground.frag filters edges of shadows on a plane seen face-on."""

PROP_SHADE_M = 0.6
"""Largest distance from a prop at which it shades the ground from the sky."""

GROUND_FADE_START = 0.5
"""Share of the ground's reach at which it starts to fade into the panorama."""

TILE_PX = 16
"""Side in pixels of the tiles that have masks of props, see ground_plan.py; even."""

_SHADOW_TEXELS = 1.0
"""Least distance in texels between shadow lookups for the first directional light; closer lookups
give slanted edges teeth."""

Defines = Mapping[str, object]


class _Array(NamedTuple):
    """A constant GLSL array: the type of its items, and the text of each."""

    kind: str
    items: Sequence[str]

    def declaration(self, name: str) -> str:
        """Return the GLSL declaration of the array."""
        items = ", ".join(f"{self.kind}({item})" for item in self.items)
        whole = f"{self.kind}[{len(self.items)}]"
        return f"const {whole} {name} = {whole}({items});\n"


def _variant(v: ShaderVariant) -> Defines:
    """Return the switches of a shader.

    WITH_* say what the pixels of a class may see (PIXEL_CLASSES). DAMAGED and HOLED say what the
    geometry of the scene has, for stages that run before the classes.
    """
    shown = {
        name: int(v.layer in ("all", "normals", "reflection", name) and name not in v.without)
        for name in LAYERS
    }
    return {
        **{f"LAYER_{name.upper()}": i for i, name in enumerate(LAYERS)},
        **{f"SHOWN_{name.upper()}": value for name, value in shown.items()},
        **{f"WITH_{trait}": int(trait in v.traits) for trait in PIXEL_TRAITS},
        "LAYER": LAYERS.index(v.layer),
        "DAMAGED": int(v.damage != "undamaged"),
        "HOLED": int(v.damage == "holed"),
        "LIGHTS": v.lights,
        "TRACED": int(v.traced),
        "RADIANCE": int(v.radiance),
        "OVER": int(v.over),
        "LENS": int(v.lens),
    }


def _lists(v: ShaderVariant) -> Defines:
    return {
        **{f"LIST_{name.upper()}": f"{i}u" for i, name in enumerate(PIXEL_CLASSES)},
        "LIST": f"LIST_{v.pixel_class.upper()}",
        "NO_LIST": f"{len(PIXEL_CLASSES)}u",
        "LISTS": f"{len(PIXEL_CLASSES)}u",
        "LIST_HEADER": f"{LIST_HEADER}u",
        "LIST_GROUP": f"{LIST_GROUP}u",
        "LIST_BINDING": LIST_BINDING,
    }


def _samples(v: ShaderVariant) -> Defines:
    lattice = SampleLattice(v.samples_per_axis)
    sky = SKY_PLACES[min(v.lookups, 2)]
    return {
        "SAMPLES_PER_AXIS": v.samples_per_axis,
        "SAMPLE_SLANT": lattice.slant,
        "SAMPLE_PAD": lattice.pad,
        "SKY_SAMPLES": len(sky),
        "SKY_PLACE": _Array("vec2", [f"{x}, {y}" for x, y in sky]),
        "FILTER_STEP": lattice.step,
        "FILTER_NEAR": lattice.near,
        "FILTER_SAMPLES": len(lattice.filter),
        "FILTER_OFFSET": _Array("ivec2", [f"{x}, {y}" for x, y in lattice.filter]),
        "FILTER_WEIGHT": _Array("float", [f"{weight:.8f}" for weight in lattice.filter.values()]),
    }


def _lookups(v: ShaderVariant) -> Defines:
    spread = SampleLattice(v.samples_per_axis).spread
    places = [f"{spread * x:.8f}, {spread * y:.8f}" for x, y in LOOKUP_PLACES[v.lookups]]
    # Decals are averaged over whole pixels, so two lookups share one evaluation of them. Boxes of
    # one pixel, or of one sample's share of it, add up to the same at every place.
    decals_each = v.lookups > 2
    per_axis = v.samples_per_axis if "MIXED" in v.traits else math.isqrt(v.lookups)
    return {
        "LOOKUPS": v.lookups,
        "LOOKUP_PX": LOOKUP_PX[v.lookups] * spread,
        "DECALS_EACH_LOOKUP": int(decals_each),
        "DECAL_PX": 1 / per_axis if decals_each else 1.0,
        "LOOKUP_PLACE": _Array("vec2", places),
        # surfaces beyond these numbers look like the rest of their pixel
        "MAX_PIXEL_ZONES": 3,
        "MAX_ORIENTATIONS": 4,
    }


def _environment(_: ShaderVariant) -> Defines:
    levels = environment.ROUGHNESS_LEVELS
    steps = "".join(
        f" + clamp(((roughness) - {a:.6f}) / {b - a:.6f}, 0.0, 1.0)"
        for a, b in itertools.pairwise(levels)
    )
    return {
        "SPECULAR_SIZE": f"{environment.SPECULAR_SIZE:.1f}",
        "SPECULAR_LAYERS": f"{len(levels):.1f}",
        "SPECULAR_LAYER(roughness)": f"(0.0{steps})",
        "IRRADIANCE_SIZE": f"{environment.IRRADIANCE_SIZE:.1f}",
    }


def _ground(v: ShaderVariant) -> Defines:
    ground = v.ground
    return {
        **{f"GROUND_{kind.upper()}": int(kind == ground.kind) for kind in GROUNDS},
        "GROUND_BOXES": int(ground.boxes),
        "GROUND_WET": int(ground.wet),
        "GROUND_PLANE": int(ground.plane),
        "GROUND_SHADOWS": int(ground.shadows),
        "GROUND_PROPS": int(ground.props),
        "GROUND_COARSE": int(ground.coarse),
        "GROUND_FADE_START": GROUND_FADE_START,
        "GROUND_FILTER_PX": GROUND_FILTER_PX,
        "LINE_MM": LINE_MM,
        "DAMP_SOFTNESS": DAMP_SOFTNESS,
        "DAMP_WETNESS": DAMP_WETNESS,
        "MAX_BOXES": MAX_BOXES,
        "PROP_AMBIENT_BESIDE_M": prop_light.AMBIENT_BESIDE_M,
        "PROP_SUNLIT_BESIDE_M": prop_light.SUNLIT_BESIDE_M,
        "PROP_LOWEST_SHARE": prop_light.LOWEST_SHARE,
        "PROP_OPEN_M": prop_light.OPEN_M,
        "PROP_SHADE_M": PROP_SHADE_M,
        "PROP_SHEEN": prop_light.SHEEN,
        "CYLINDER": f"{CYLINDER:.1f}",
        "TILE_PX": TILE_PX,
    }


def _damage(v: ShaderVariant) -> Defines:
    """Return the constants of all forms of damage, and macros that loop over the forms.

    Damages are sorted in the order of the forms.
    """
    forms = forms_of(v.kinds)
    ends = [f"form_{number}_end" for number in range(len(forms))]
    parts = list(zip(forms, ["0", *ends], ends, strict=False))
    moving = [
        f"EACH_NEAR({first}, {end}, DamageField, {each.glsl}_field, USE)"
        for each, first, end in parts
        if each.amount
    ]
    marks = [
        f"EACH_NEAR({first}, {end}, DamageMark, {each.glsl}_mark, USE)"
        for each, first, end in parts
        if each.marked
    ]
    holes = [(f"outside_{each.glsl}(i, q)", end) for each, _, end in parts if each.outline]
    outside = "".join(f"(i) < {end} ? {distance} : " for distance, end in holes[:-1])
    return {
        "DAMAGE_FADE_START_MM": f"{fields.FADE_START_MM:.1f}",
        "DAMAGE_FADE_END_MM": f"{fields.FADE_END_MM:.1f}",
        "DAMAGE_PROUD_MM": f"{fields.PROUD_MM:.1f}",
        "DAMAGE_FLAT_MM": f"{fields.FLAT_MM:.1f}",
        "DAMAGE_DEEPEST_MM": f"{fields.DEEPEST_MM:.1f}",
        "REACH_MARGIN_MM": f"{REACH_MARGIN_MM:.1f}",
        **{name: value for form in forms for name, value in form.constants.items()},
        "EACH_DAMAGE(USE)": " ".join(moving),
        "EACH_MARK(USE)": " ".join(marks),
        "OUTSIDE_HOLE(i, q)": f"({outside}{holes[-1][0]})",
    }


CONSTANTS: Mapping[str, Callable[[ShaderVariant], Defines]] = {
    "variant": _variant,
    "pixel_list": _lists,
    "samples": _samples,
    "lookups": _lookups,
    "environment": _environment,
    "units": lambda _: {
        "MM": "0.001",
        "PI": f"{math.pi:.8f}",
        "NO_DEPTH": "uintBitsToFloat(0x7f800000u)",
        "SKY_DEPTH": _SKY_DEPTH,
    },
    "labels": lambda _: {
        "SPREADER_ID": f"{SPREADER_ID}u",
    },
    "materials": lambda _: {
        "SHEET_MATERIAL": MATERIALS.index("paint_sheet"),
    },
    "zones": lambda _: {
        "SPREADER_ZONE": f"{SPREADER_ZONE}u",
        "SEAL_ZONE": f"{SEAL_ZONE}u",
        "SEAL_PARTS": f"{len(PARTS)}u",
        "HOLE_ZONE": f"{HOLE_ZONE}u",
        "ZONE_MATERIAL": ZONE_TURN - 1,
        "ZONE_TURN": ZONE_TURN,
        "ZONE_GEAR": ZONE_GEAR,
        "ZONE_SMALL": ZONE_SMALL,
        "ZONE_LEVEL": ZONE_LEVEL,
        "ZONE_SHEET": ZONE_SHEET,
        "CORRUGATED_ALONG_Y": f"{SHEET_NUMBERS[CORRUGATED_ALONG_Y]}",
    },
    "damage": _damage,
    "ground": _ground,
    "inside": lambda _: {
        "INSIDE_LIGHT": _INSIDE_LIGHT,
        **{f"INSIDE_{name.upper()}": f"vec3{rgb}" for name, rgb in INSIDE_ALBEDO.items()},
    },
    "decals": lambda _: {
        "NEAR_CELL_MM": f"{NEAR_CELL_MM:.1f}",
        "ART_SIZE": f"{ART_SIZE:.1f}",
        **glyph_runs.DEFINES,
        "DECAL_SHEET": DECAL_SHEET,
        **{f"DECAL_{name.upper()}": f"{value}" for name, value in DECAL_KINDS.items()},
    },
    "noise": lambda _: {
        "NOISE_SIZE": f"{NOISE_SIZE:.1f}",
        "NOISE_LEVELS": NOISE_LEVELS,
        "NORMAL_REACH": f"{NORMAL_REACH}",
        "SCRATCHED_SHARE": f"{noise_tiles().scratched:.6f}",
    },
    "rust": lambda _: rust.DEFINES,
    "reflectance": lambda _: {
        "MIN_ROUGHNESS": MIN_ROUGHNESS,
        "DIELECTRIC_F0": DIELECTRIC_F0,
        "DIELECTRIC_INDEX": DIELECTRIC_INDEX,
        "POROUS_LOSS": POROUS_LOSS,
        "WATER_F0": WATER_F0,
        "WATER_INDEX": WATER_INDEX,
    },
    "sky_visibility": lambda _: {
        "LIGHT_STEPS": f"{LIGHT_STEPS:.1f}",
        "LIGHT_TIMES": f"{LIGHT_TIMES:.1f}",
        "LOBE_CELLS": LOBE_CELLS,
    },
    "shadow": lambda _: {"SHADOW_TEXELS": _SHADOW_TEXELS},
    "tone": lambda _: {
        "TONE_FRESNEL": tone_curve.FRESNEL,
        "TONE_SHOULDER": tone_curve.SHOULDER,
        "TONE_DESATURATION": tone_curve.DESATURATION,
    },
    "bake": lambda _: {"GUTTER_STEPS": GUTTER_STEPS},
}
"""Groups of constants by name: from a variant to GLSL macros and their text."""


def constants_text(group: str, variant: ShaderVariant) -> str:
    """Return the GLSL text of a group of constants.

    Raises:
        KeyError: There is no such group.
    """
    return "".join(
        value.declaration(name) if isinstance(value, _Array) else f"#define {name} {value}\n"
        for name, value in CONSTANTS[group](variant).items()
    )
