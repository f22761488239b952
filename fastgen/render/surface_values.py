"""Values of the shaders' uniform blocks: materials, layers and damages of a scene."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.damage_law import reach_mm
from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.reflectance import DIELECTRIC_F0, mean_specular_albedo
from fastgen.render.constants import REACH_MARGIN_MM
from fastgen.render.noise import noise_tiles
from fastgen.render.rust import rate_of, rusted
from fastgen.scene import Color, Damage, Scene
from fastgen.scene.damage_kinds import form_of, forms_of
from fastgen.scene.limits import HASPS, MAX_FORMS

_TILE_OF_SCALE = 4.0
"""Typical lengths of a noise pattern in one tile."""


SEAL_STEEL_ALBEDO = (0.5, 0.5, 0.49)
"""Linear albedo of the pins and cables of seals."""


def _materials(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return (albedo and roughness) and traits of each material, float32 [M, 4] each.

    The traits are metallic, proneness to rust and share of the paint's layers. Weathered galvanised
    steel has an albedo of about 0.35 to 0.5 (measured tables of building materials), rubber and tar
    are near 0.03. Cables are greased steel. Seals are new: they have no layers.
    """
    surface, bodies = scene.surface, {seal.hasp: seal.albedo for seal in scene.seals}
    paint = np.array(surface.paint.albedo)
    rough = surface.paint.roughness
    rows: dict[str, tuple[ArrayLike, float, float, float, float]] = {
        # albedo, roughness, metallic, proneness, layers
        "paint_sheet": (paint, rough, 0.0, 1.0, 1.0),
        "paint_frame": (paint * 0.93, rough, 0.0, 1.6, 1.0),
        "casting": (paint * 0.8, min(rough + 0.15, 1.0), 0.0, 2.6, 1.0),
        "galvanized": ((0.42, 0.42, 0.41), 0.55, 0.55, 1.3, 0.5),
        "rubber": ((0.022, 0.022, 0.023), 0.75, 0.0, 0.0, 0.35),
        "underside": (paint * 0.25 + 0.02, 0.85, 0.0, 1.8, 0.8),
        "spreader": (scene.spreader.albedo, 0.5, 0.0, 0.4, 1.0),
        "cable": ((0.07, 0.068, 0.065), 0.6, 0.3, 0.6, 0.5),
        **{
            f"seal_{hasp}": (bodies.get(hasp, (0.5, 0.5, 0.5)), 0.4, 0.0, 0.0, 0.0)
            for hasp in range(HASPS)
        },
        "seal_steel": (SEAL_STEEL_ALBEDO, 0.4, 0.8, 0.0, 0.0),
    }
    base = np.array([[*np.asarray(rows[m][0]), rows[m][1]] for m in MATERIALS], np.float32)
    trait = np.array([[*rows[m][2:], 0.0] for m in MATERIALS], np.float32)
    return base, trait


class SceneMaterials:
    """Mean colours of the materials of one scene after rust.

    All members are computed on first use and kept. Kept by the renderer for each PreparedScene.

    Args:
        prepared: The scene.
    """

    def __init__(self, prepared: PreparedScene) -> None:
        self._prepared = prepared

    @cached_property
    def reflectances(self) -> tuple[Color, ...]:
        """Reflectance of each of MATERIALS for diffuse light, rust included.

        Without dirt, which changes the mean over a roof by 3 %, and wetness, which darkens soaked
        surfaces by up to 20 %.
        """
        shape, scene = self._prepared.spreader, self._prepared.scene
        meshes = (self._prepared.container, *(() if shape is None else (shape.mesh,)))
        base, trait = _materials(scene)
        rust = scene.surface.rust
        rate = rate_of(rust.coverage, self._prepared.container) * trait[:, 1:2].astype(float)
        albedo, _ = rusted(base[:, :3].astype(float), rate, np.array(rust.albedo), meshes)
        mirrored = np.array([[mean_specular_albedo(DIELECTRIC_F0, float(row[3]))] for row in base])
        return tuple(map(tuple, (mirrored + (1 - mirrored) * albedo).tolist()))

    @property
    def sheet(self) -> Color:
        """Reflectance of the painted sheet."""
        return self.reflectances[MATERIALS.index("paint_sheet")]


def scene_values(
    prepared: PreparedScene, background_size: int, ground: NDArray[np.float32] | None = None
) -> Mapping[str, ArrayLike]:
    """Return the members of SCENE_BLOCK.

    Args:
        prepared: The scene.
        background_size: Side of the background map in texels, 0 without one.
        ground: Radiance of the ground that each side sees, see SurroundingLight; None without one.
    """
    scene = prepared.scene
    surface = scene.surface
    base, trait = _materials(scene)
    return {
        "material_base": base,
        "material_trait": trait,
        "noise_lost": noise_tiles().lost_deviation.reshape(-1, 4),
        "dirt_albedo": surface.dirt.albedo,
        "dirt_strength": surface.dirt.strength,
        "rust_albedo": surface.rust.albedo,
        "rust_roughness": surface.rust.roughness,
        "noise_offset_mm": surface.noise_offset_mm,
        "tone_variation": surface.paint.tone_variation,
        "ageing_strength": surface.ageing.strength,
        "ageing_reach_mm": max(surface.ageing.reach_mm, 1.0),
        "dirt_reach_mm": max(surface.dirt.reach_mm, 1.0),
        "rust_rate": rate_of(surface.rust.coverage, prepared.container),
        "rust_tile_mm": surface.rust.scale_mm * _TILE_OF_SCALE,
        "scratch_coverage": surface.scratches.coverage,
        "scrape_share": surface.scratches.scrapes,
        "dirt_streaks": surface.dirt.streaks,
        "bleach": surface.paint.bleach,
        "wear_strength": surface.wear.strength,
        "wear_tile_mm": surface.wear.scale_mm * _TILE_OF_SCALE,
        "wetness": scene.weather.wetness,
        "background_size": float(background_size),
        "container_id": prepared.numbers.container,
        "first_seal_id": prepared.numbers.first_seal,
        "undamaged_value": prepared.numbers.undamaged,
        "side_ground_radiance": (
            np.zeros((6, 4)) if ground is None else np.insert(ground, 3, 1.0, axis=1)
        ),
        "above": (*scene.spreader.albedo, float(scene.spreader.present)),
    }


def damage_values(
    prepared: PreparedScene,
    shown: tuple[Damage, ...],
    kinds: tuple[str, ...],
    threshold_mm: float,
    inner_row: int,
) -> Mapping[str, ArrayLike]:
    """Return the members of DAMAGE_BLOCK.

    Args:
        prepared: The scene.
        shown: Those of its damages that are drawn, at least one.
        kinds: Kinds that the program can draw, see ShaderVariant.
        threshold_mm: Displacement above which a surface counts as damaged.
        inner_row: First row of the interior in the visibility buffer.
    """
    valued = [
        (damage, value)
        for damage, value in zip(prepared.scene.damages, prepared.numbers.damages, strict=True)
        if damage in shown
    ]
    forms = forms_of(kinds)
    valued.sort(key=lambda pair: forms.index(form_of(pair[0])))
    damages = [damage for damage, _ in valued]
    shape = np.zeros((len(damages), 12), np.float32)
    for row, damage in zip(shape, damages, strict=True):
        row[: len(damage.shape)] = damage.shape
        row[-1] = damage.fresh
    counts = np.zeros(MAX_FORMS, int)
    for damage in damages:
        counts[forms.index(form_of(damage))] += 1
    ends = {f"form_{number}_end": end for number, end in enumerate(np.cumsum(counts).tolist())}
    return {
        "damage_origin": [(*d.origin_mm, _squared_reach(d)) for d in damages],
        "damage_along": [(*d.along, d.size_mm[0] / 2) for d in damages],
        "damage_across": [(*d.across, d.size_mm[1] / 2) for d in damages],
        "damage_inward": [(*d.inward, d.depth_mm) for d in damages],
        "damage_shape": shape.reshape(-1, 4),
        "damage_reach": [(*reach_mm(d), value) for d, value in valued],
        "damage_bare": [(*d.bare_albedo, d.paint_loss) for d in damages],
        "damage_count": len(damages),
        **ends,
        "hole_count": sum(form_of(d).outline is not None for d in damages),
        "damage_threshold_mm": threshold_mm,
        "inner_row": inner_row,
    }


def _squared_reach(damage: Damage) -> float:
    """Return the squared radius in mm^2 of a ball around all pixels that a damage may change."""
    return float(np.square(np.array(reach_mm(damage)) + REACH_MARGIN_MM).sum())
