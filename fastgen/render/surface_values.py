"""A scene's materials, layers and damages as the values of the shader's uniform blocks."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from fastgen.camera.projection import View
from fastgen.geometry.damage_law import reach_mm
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.geometry.spreader_parts import CABLE_CHART, CABLES, Hang, cable_feet_mm
from fastgen.light.reflectance import DIELECTRIC_F0, mean_specular_albedo
from fastgen.render.programs import REACH_MARGIN_MM, SPREADER_ZONE, noise_deviation
from fastgen.render.rust import rusted
from fastgen.scene import Color, Damage, Scene, Spreader, Surface
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.object_ids import mask_values

_TILE_OF_SCALE = 4.0
"""A noise tile spans this many of its pattern's typical lengths."""


def _materials(surface: Surface, spreader: Spreader) -> tuple[np.ndarray, np.ndarray]:
    """(albedo and roughness, traits) of each material, float32 [M, 4] each.

    Traits: metallic, proneness to rust, share of the paint's layers. Albedo of hot-dip zinc:
    the range for weathered galvanised steel lies about 0.35 to 0.5 (measured tables of building
    materials); rubber and tar are near 0.03. Cables are steel under grease.
    """
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
        "spreader": (spreader.albedo, 0.5, 0.0, 0.6, 1.0),
        "cable": ((0.07, 0.068, 0.065), 0.6, 0.3, 0.6, 0.5),
    }
    base = np.array([[*np.asarray(rows[m][0]), rows[m][1]] for m in MATERIALS], np.float32)
    trait = np.array([[*rows[m][2:], 0.0] for m in MATERIALS], np.float32)
    return base, trait


@lru_cache(maxsize=2)  # all cameras of a scene ask alike
def reflectances(scene: Scene, meshes: tuple[Mesh, ...]) -> tuple[Color, ...]:
    """What each of MATERIALS gives back, rust included, of light from all around.

    meshes: what the scene's container and spreader are made of. Without dirt, which changes the
    mean over a roof by 3 %, and wetness, which darkens what is soaked by up to 20 %.
    """
    base, _ = _materials(scene.surface, scene.spreader)
    albedo, _ = _rusted(scene, meshes)
    mirrored = np.array([[mean_specular_albedo(DIELECTRIC_F0, float(row[3]))] for row in base])
    return tuple(map(tuple, (mirrored + (1 - mirrored) * albedo).tolist()))


@lru_cache(maxsize=4)  # of container and spreader, and of what cables are
def _rusted(scene: Scene, meshes: tuple[Mesh, ...]) -> tuple[np.ndarray, np.ndarray]:
    """As rust.rusted, of the scene's materials."""
    rust = scene.surface.rust
    base, trait = _materials(scene.surface, scene.spreader)
    coverage = rust.coverage * trait[:, 1:2].astype(float)
    return rusted(base[:, :3].astype(float), coverage, np.array(rust.albedo), meshes)


def scene_values(scene: Scene, background_size: int) -> Mapping[str, ArrayLike]:
    """All members of SCENE_BLOCK for `scene`."""
    surface = scene.surface
    base, trait = _materials(surface, scene.spreader)
    return {
        "material_base": base,
        "material_trait": trait,
        "noise_lost": noise_deviation(),
        "dirt_albedo": surface.dirt.albedo,
        "dirt_strength": surface.dirt.strength,
        "rust_albedo": surface.rust.albedo,
        "rust_roughness": surface.rust.roughness,
        "noise_offset_mm": surface.noise_offset_mm,
        "tone_variation": surface.paint.tone_variation,
        "ageing_strength": surface.ageing.strength,
        "ageing_reach_mm": max(surface.ageing.reach_mm, 1.0),
        "dirt_reach_mm": max(surface.dirt.reach_mm, 1.0),
        "rust_coverage": surface.rust.coverage,
        "rust_tile_mm": surface.rust.scale_mm * _TILE_OF_SCALE,
        "scratch_coverage": surface.scratches.coverage,
        "wear_strength": surface.wear.strength,
        "wear_tile_mm": surface.wear.scale_mm * _TILE_OF_SCALE,
        "wetness": scene.weather.wetness,
        "background_size": float(background_size),
        "above": (*scene.spreader.albedo, float(scene.spreader.present)),
    }


def damage_values(
    scene: Scene, shown: tuple[Damage, ...], threshold_mm: float, inner_row: int
) -> Mapping[str, ArrayLike]:
    """All members of DAMAGE_BLOCK for the damages of `scene` that are shown, at least one."""
    valued = [
        (damage, value)
        for damage, value in zip(scene.damages, mask_values(scene.damages), strict=True)
        if damage in shown
    ]
    order = ("perforation", "dented", "concave", "axis")
    valued.sort(key=lambda pair: order.index(pair[0].kind))
    damages = [damage for damage, _ in valued]
    shape = np.zeros((len(damages), 12), np.float32)
    for row, (damage, value) in zip(shape, valued, strict=True):
        row[: len(damage.shape)] = damage.shape
        row[11] = value
    return {
        "damage_origin": [(*d.origin_mm, _squared_reach(d)) for d in damages],
        "damage_along": [(*d.along, d.size_mm[0] / 2) for d in damages],
        "damage_across": [(*d.across, d.size_mm[1] / 2) for d in damages],
        "damage_inward": [(*d.inward, d.depth_mm) for d in damages],
        "damage_shape": shape.reshape(-1, 4),
        "damage_count": len(damages),
        "hole_count": sum(damage.kind == "perforation" for damage in damages),
        "dent_end": sum(damage.kind in ("perforation", "dented") for damage in damages),
        "bowl_end": sum(damage.kind != "axis" for damage in damages),
        "damage_threshold_mm": threshold_mm,
        "inner_row": inner_row,
    }


def _squared_reach(damage: Damage) -> float:
    """Of a ball that holds all pixels that it may change, in mm^2."""
    return float(np.square(np.array(reach_mm(damage)) + REACH_MARGIN_MM).sum())


def cable_values(scene: Scene, mesh: Mesh | None, view: View) -> dict[str, ArrayLike]:
    """Members of VIEW_BLOCK about the cables of a scene's spreader, none where `mesh` is None."""
    if mesh is None:
        none: dict[str, ArrayLike] = {"cable_zone": -1.0, "cable_rusted": np.zeros(4)}
        return {**none, "cable_foot": np.zeros((CABLES, 4))}
    feet = cable_feet_mm(Hang(KINDS[scene.container.kind], scene.spreader.gap_mm))
    from_eye = np.array(feet) / 1000 - view.position_m
    right, down = view.rotation[:2] / view.focal_px
    # by how much a pixel to the right or down moves `aside` of cables.glsl; a lens is left out
    moved = np.hypot(*(np.cross(from_eye, way)[:, 2] for way in (right, down)))
    chart = mesh.chart_index(CABLE_CHART)
    zone = next(i for i, zone in enumerate(mesh.zones) if zone.chart == chart)  # not the caps'
    albedo, share = (row[MATERIALS.index("cable")] for row in _rusted(scene, (mesh,)))
    return {
        "cable_zone": float(SPREADER_ZONE + zone),
        "cable_rusted": [*albedo, *share],
        "cable_foot": np.column_stack([from_eye, 1 / np.maximum(moved, 1e-9)]),
    }
