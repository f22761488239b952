"""Labels of scenes with several containers, from rays at each container alone."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from fastgen.camera.projection import View
from fastgen.geometry.container import build_container
from fastgen.scene import Pose, Scene, Spreader
from tests import oracle

_mesh_of = lru_cache(4)(build_container)  # equal meshes share one ray caster


@dataclass
class Truth:
    """Labels and depth by the ray through each pixel.

    Attributes:
        ids: int [H, W], values of the id target.
        damage: int [H, W], values of the damage target.
        depth_m: [H, W], depth along the view axis; inf where no container, seal or spreader is hit.
        owner: int [H, W], index of the container, -1 for none.
    """

    ids: np.ndarray
    damage: np.ndarray
    depth_m: np.ndarray
    owner: np.ndarray


def alone(scene: Scene) -> list[tuple[Scene, Pose]]:
    """Return each container as a scene of its own in its own frame, with its pose."""
    found = [(replace(scene, neighbours=()), Pose())]
    for each in scene.neighbours:
        own = replace(
            scene,
            container=each.container,
            decals=each.decals,
            damages=each.damages,
            seals=each.seals,
            spreader=Spreader(),
            neighbours=(),
        )
        found.append((own, each.pose))
    return found


def truth(scene: Scene, view: View, threshold_mm: float, pixels: np.ndarray | None = None) -> Truth:
    """Cast rays at each container alone, and keep the nearest hits.

    Args:
        scene: The scene; ground and props are not hit.
        view: Projection of the image.
        threshold_mm: Displacement above which a surface counts as damaged.
        pixels: Image positions [..., 2] to look through instead of the pixel centres.
    """
    shape = view.rays(pixels)[1].shape[:-1]
    found = Truth(
        np.zeros(shape, np.int64),
        np.zeros(shape, np.int64),
        np.full(shape, np.inf),
        np.full(shape, -1),
    )
    following = 1
    instances: dict[int, int] = {}
    for number, (own, pose) in enumerate(alone(scene)):
        mesh = _mesh_of(own.container.kind, own.container.profiles)
        seen_from = view.in_frame(pose)
        hits = oracle.cast(mesh, seen_from, own, pixels)
        numbers = np.zeros(65536, np.int64)
        numbers[oracle.SPREADER] = oracle.SPREADER
        own_id = 1
        for _ in range(1 + sum(bool(decal.class_name) for decal in own.decals)):
            numbers[own_id] = following
            own_id, following = (600 if k == 199 else k + 1 for k in (own_id, following))
        values = np.zeros(65536, np.int64)
        counts: dict[int, int] = {}
        values[101] = 101 + number
        for item in own.damages:
            category = oracle.CATEGORIES[item.kind]
            counts[category] = counts.get(category, 0) + 1
            before = instances.get(category, 0)
            values[100 * category + counts[category]] = 100 * category + before + counts[category]
        for category, count in counts.items():
            instances[category] = instances.get(category, 0) + count
        ids = numbers[oracle.object_ids(own, mesh, hits)]
        damage = values[oracle.damage_values(own, hits, threshold_mm)]
        depth = hits.depth_m
        if own.seals:
            seals, seal_depth = oracle.seal_hits(own, seen_from, pixels)
            sealed = seal_depth < depth
            ids = np.where(sealed, seals + 4 * number, ids)
            damage = np.where(sealed, 101 + number, damage)  # a part of its container
            depth = np.minimum(depth, seal_depth)
        through = (hits.hole >= 0) & ~hits.hit & (found.owner < 0)
        nearer = (depth < found.depth_m) | through
        found.ids[nearer], found.damage[nearer] = ids[nearer], damage[nearer]
        found.owner[nearer], found.depth_m[nearer] = number, depth[nearer]
    return found
