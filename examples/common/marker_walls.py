"""Scenes with ends full of markers, the crops of the markers, and variants without single elements.

Many markers per image teach a classifier more. Everything here is a function of scenes, so that two
renderers can get exactly the same ones.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from unittest.mock import patch

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen import Config
from fastgen.classes import MARKER_CLASSES
from fastgen.geometry.container import build_container
from fastgen.geometry.mesh import Mesh
from fastgen.light.sky_visibility import open_sky
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe
from fastgen.sample import Object, Sample
from fastgen.sampling.contents import sheet_sizes
from fastgen.sampling.streams import stream
from fastgen.scene import Decal, Scene, Spreader

CAMERAS = ("Cl", "Cr")
"""Cameras that look at the ends, without and with doors."""

CROP_PX = 24
"""Side of a crop. A marker is 15 to 25 pixels wide in an image of 192x192."""

LIGHTS = (
    *("city", "city_2", "courtyard", "dawn", "forest", "forest_2", "park", "sky"),
    *("sunrise", "sunset", "sunset_2", "venice"),
)
"""The outdoor daylight HDRIs of the stored Cycles images.

The list is fixed, so that HDRIs added later do not change a scene.
"""

CONFIG = Config.from_values(
    {
        "container": {
            "kinds": {"20": 1.0}
        },  # smallest textures; the ends are the same for all sizes
        "environment": {"names": list(LIGHTS)},
        "cameras": {name: {"focal_mm": 62.0} for name in CAMERAS},
        # these may lie over or under other decals
        "markings": {
            "runs": 0.0,
            "identifiers": {"painted_over": 0.0},
            "repairs": {"probability": 0.0},
            "chalk": {"probability": 0.0},
        },
    }
)

_FACES = ("no_door", "door")
_FITTINGS = ("marker_holder", "marker_rivets")
_EDGE_MM = 130.0  # because sheets reach a little under posts and rails
_GAP_MM = 12.0
_SIDE_MM = (215.0, 270.0)
_TRIES = 900
_MARGIN = 0.1  # margin of a crop on each side, as a share of the marker's box
_LEAST_SEEN = 0.6


def crowded(scene: Scene) -> Scene:
    """Return `scene` with its ends filled with markers, without overlap with texts and stickers.

    They replace the markers of the ends and the holders and rivets of these.
    Positions are drawn one after another and rejected if the marker touches another decal. Two
    diamonds touch if the L1 distance of their centres is below the diagonal.
    """
    mesh = build_container(scene.container.kind, scene.container.profiles)
    sizes = sheet_sizes(mesh)
    kept = tuple(
        d
        for d in scene.decals
        if d.face not in _FACES or (d.kind != "marker" and d.art not in _FITTINGS)
    )
    made: list[Decal] = []
    for face in _FACES:
        rng = stream(scene.seed, scene.index, f"crowd.{face}")
        diagonal = round(float(rng.uniform(*_SIDE_MM)) * np.sqrt(2), 1)
        taken = np.array(
            [(*d.center_mm, *d.size_mm) for d in kept if d.face == face], float
        ).reshape(-1, 4)
        centers: list[tuple[float, float]] = []
        reach = _EDGE_MM + diagonal / 2
        tried = rng.uniform(reach, np.array(sizes[face]) - reach, (_TRIES, 2)).round(1)
        apart = np.abs(tried[:, None] - taken[:, :2]) - taken[:, 2:] / 2 - diagonal / 2 - _GAP_MM
        for x, y in tried[(apart.max(axis=2) > 0).all(axis=1)].tolist():
            if all(abs(x - a) + abs(y - b) > diagonal + 2 * _GAP_MM for a, b in centers):
                centers.append((x, y))
        names = rng.choice(MARKER_CLASSES, len(centers))
        tilts = rng.uniform(-2.5, 2.5, len(centers)).round(2)
        wears = rng.uniform(0.0, 0.35, len(centers)).round(3)
        made += [
            Decal(
                "marker",
                str(name),
                face,
                center,
                (diagonal, diagonal),
                rotation_deg=float(tilt),
                art=str(name),
                wear=float(wear),
            )
            for name, center, tilt, wear in zip(names, centers, tilts, wears, strict=True)
        ]
    return replace(scene, decals=(*kept, *made))


def markers(sample: Sample) -> list[Object]:
    """Return the markers of an image that are visible enough to be recognized, in their order."""
    return [
        item
        for item in sample.objects
        if item.class_name in MARKER_CLASSES
        and not (item.ignored or item.truncated)
        and item.visible_fraction >= _LEAST_SEEN
    ]


def crops(image: NDArray[np.uint8], items: list[Object]) -> NDArray[np.uint8]:
    """Return the pixels [N, CROP_PX, CROP_PX, 3] of `items` in `image` [H, W, 3].

    Crops follow the exact boxes from geometry. The image may therefore come from another renderer
    with the same scene and camera.
    """
    made = np.empty((len(items), CROP_PX, CROP_PX, 3), np.uint8)
    for crop, item in zip(made, items, strict=True):
        assert item.amodal_bbox is not None
        x0, y0, x1, y1 = item.amodal_bbox
        scale = CROP_PX / (max(x1 - x0, y1 - y0) * (1 + 2 * _MARGIN))
        middle = np.array([x0 + x1, y0 + y1]) / 2
        shift = CROP_PX / 2 - 0.5 - scale * (middle - 0.5)
        matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
        crop[:] = cv2.warpAffine(image, matrix, (CROP_PX, CROP_PX), borderMode=cv2.BORDER_REPLICATE)
    return made


def _no_rust(scene: Scene) -> Scene:
    surface = scene.surface
    rust, scratches = replace(surface.rust, coverage=0.0), replace(surface.scratches, coverage=0.0)
    return replace(scene, surface=replace(surface, rust=rust, scratches=scratches))


def _no_dirt(scene: Scene) -> Scene:
    surface = scene.surface
    dirt, ageing = replace(surface.dirt, strength=0.0), replace(surface.ageing, strength=0.0)
    return replace(scene, surface=replace(surface, dirt=dirt, ageing=ageing))


def _unworn(scene: Scene) -> Scene:
    return replace(scene, decals=tuple(replace(d, wear=0.0) for d in scene.decals))


def _markers_only(scene: Scene) -> Scene:
    return replace(scene, decals=tuple(d for d in scene.decals if d.kind == "marker"))


def _one_light(scene: Scene) -> Scene:
    return replace(scene, environment=replace(scene.environment, name=LIGHTS[0]))


def _no_spreader(scene: Scene) -> Scene:
    return replace(scene, spreader=Spreader())


def _one_paint(scene: Scene) -> Scene:
    paint = replace(scene.surface.paint, albedo=(0.2, 0.2, 0.2))
    return replace(scene, surface=replace(scene.surface, paint=paint))


def _plain(scene: Scene) -> Scene:
    for off in (_no_rust, _no_dirt, _unworn, _markers_only, _one_light, _no_spreader):
        scene = off(scene)
    return _one_paint(scene.undamaged())


SHADE, EVERYTHING = "shade of parts on each other", "all of these"
"""Elements whose removal also removes all occlusion of the sky.

No field of a scene controls that, see `without`.
"""

ELEMENTS: dict[str, Callable[[Scene], Scene]] = {
    "rust and scratches": _no_rust,
    "dirt and ageing": _no_dirt,
    "wear of markers": _unworn,
    "texts and stickers": _markers_only,
    "different lights": _one_light,
    "spreader": _no_spreader,
    "damage": Scene.undamaged,
    "different paints": _one_paint,
    SHADE: lambda scene: scene,
    EVERYTHING: _plain,
}
"""For each element of realism, a function that returns the scene without it."""

_SKY = (SHADE, EVERYTHING)


@contextmanager
def without(element: str) -> Iterator[None]:
    """Render without the part of `element` that no field of a scene controls."""

    def unhidden(_: SkyVisibilityProbe, container: Mesh, *__: object) -> LitMesh:
        dark = np.zeros_like(container.normals)
        return LitMesh(container, open_sky(container.normals), dark, dark)

    with (
        patch.object(SkyVisibilityProbe, "container_light", unhidden)
        if element in _SKY
        else nullcontext()
    ):
        yield
