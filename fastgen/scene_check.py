"""Refuses scenes and cameras that cannot be drawn: those made or changed by hand, or read."""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from fastgen.artwork import art_images, glyph_tiles
from fastgen.classes import DAMAGE_CLASSES, DETECTION_CLASSES
from fastgen.container_layout import KINDS
from fastgen.damage import LOBES
from fastgen.damage_config import MAX_INSTANCES
from fastgen.errors import ConfigError
from fastgen.mesh import SHEET_FACES
from fastgen.programs import DECAL_KINDS, MAX_DAMAGES
from fastgen.records import nearest
from fastgen.scene import Camera, Damage, Decal, Scene

MAX_DECALS = 4096
"""Rows of a texture that every driver takes several times over."""

_SHAPES = {"axis": 0, "concave": 0, "dented": 6, "perforation": 1 + 2 * LOBES}
"""How many numbers Damage.shape holds."""

_FAR = 1e6
"""Millimetres, or degrees, that no number of a sensible scene passes: the GPU counts in float32."""

_ART_KINDS = ("marker", "sticker", "emblem")
_LABELS = ("", *DETECTION_CLASSES[1:])


def check_scene(scene: Any) -> Scene:
    """`scene`, if it can be drawn. Raises ConfigError that names the first part that cannot be."""
    if not isinstance(scene, Scene):
        raise ConfigError(
            f"scene: {type(scene).__name__} is no Scene; take one of Generator.scene or "
            "Scene.from_json"
        )
    _one_of(scene.container.kind, KINDS, "scene.container.kind")
    for i, camera in enumerate(scene.cameras):
        check_camera(camera, f"scene.cameras[{i}]")
    if len(scene.decals) > MAX_DECALS:
        raise ConfigError(f"scene.decals: {len(scene.decals)} are more than {MAX_DECALS}")
    for i, decal in enumerate(scene.decals):
        _named(_check_decal, decal, f"scene.decals[{i}]")
    if len(scene.damages) > MAX_DAMAGES:
        raise ConfigError(f"scene.damages: {len(scene.damages)} are more than {MAX_DAMAGES}")
    for i, damage in enumerate(scene.damages):
        _named(_check_damage, damage, f"scene.damages[{i}]")
    for kind, count in Counter(damage.kind for damage in scene.damages).items():
        if count > MAX_INSTANCES:
            raise ConfigError(
                f"scene.damages: {count} of kind {kind}; mask values tell {MAX_INSTANCES} apart"
            )
    return scene


def check_camera(camera: Any, path: str = "camera") -> Camera:
    """`camera`, if it sees anything. Raises ConfigError that begins with `path`."""
    if not isinstance(camera, Camera):
        raise ConfigError(f"{path}: {camera!r} is neither a Camera nor the name of one")
    _named(_check_camera, camera, path)
    return camera


def _named(check: Callable[[Any], None], part: Any, path: str) -> None:
    try:
        check(part)
    except ConfigError as error:
        raise ConfigError(f"{path}.{error}") from None
    except TypeError:
        raise ConfigError(f"{path}: holds something of a wrong type: {part!r}") from None


def _one_of(name: str, choices: Iterable[str], path: str) -> None:
    known = tuple(choices)
    if name not in known:
        raise ConfigError(f"{path}: {name!r} is unknown{nearest(name, known)}")


def _bounded(part: Any, *names: str) -> None:
    for name in names:
        value = getattr(part, name)
        numbers = value if isinstance(value, tuple) else (value,)
        if not all(-_FAR <= number <= _FAR for number in numbers):
            raise ConfigError(f"{name}: {value!r} is out of range; give -{_FAR:g} to {_FAR:g}")


def _positive(part: Any, *names: str) -> None:
    _bounded(part, *names)
    for name in names:
        value = getattr(part, name)
        if not min(value if isinstance(value, tuple) else (value,)) > 0:
            raise ConfigError(f"{name}: {value!r} is out of range; give more than 0")


def _check_camera(camera: Camera) -> None:
    _positive(camera, "focal_mm", "sensor_width_mm")
    _bounded(camera, "position_mm", "target_mm", "roll_deg", "exposure_ev")
    if math.dist(camera.position_mm, camera.target_mm) < 1e-3:
        raise ConfigError(f"target_mm: {camera.target_mm} is where the camera itself stands")


def _check_decal(decal: Decal) -> None:
    _one_of(decal.kind, set(DECAL_KINDS) - {"stripes"}, "kind")
    _one_of(decal.face, SHEET_FACES, "face")
    _one_of(decal.class_name, _LABELS, "class_name")
    _positive(decal, "size_mm")
    _bounded(decal, "center_mm", "rotation_deg", "albedo", "wear")
    if decal.kind == "text":
        _one_of(decal.font, glyph_tiles()[1], "font")
        _positive(decal, "cap_mm")
        if not decal.text.strip():
            raise ConfigError("lines: nothing to write")
    elif decal.kind in _ART_KINDS and decal.art != "stripes":
        _one_of(decal.art, art_images()[1], "art")


def _check_damage(damage: Damage) -> None:
    _one_of(damage.kind, DAMAGE_CLASSES, "kind")
    _positive(damage, "size_mm")
    _bounded(damage, "origin_mm", "along", "across", "inward", "depth_mm", "shape")
    axes = np.array([damage.along, damage.across, damage.inward])
    if np.abs(axes @ axes.T - np.eye(3)).max() > 1e-3:
        raise ConfigError("along, across, inward: are not three unit vectors at right angles")
    if len(damage.shape) != _SHAPES[damage.kind]:
        raise ConfigError(
            f"shape: a {damage.kind} has {_SHAPES[damage.kind]} numbers, not {len(damage.shape)}"
        )
