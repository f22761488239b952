"""Refuses scenes and cameras that cannot be drawn: those made or changed by hand, or read."""

import math
from collections import Counter
from collections.abc import Collection
from typing import Any

from fastgen.artwork import art_images, glyph_tiles
from fastgen.classes import DAMAGE_CLASSES, DETECTION_CLASSES
from fastgen.container_layout import KINDS
from fastgen.damage import LOBES
from fastgen.damage_config import MAX_INSTANCES
from fastgen.errors import ConfigError
from fastgen.mesh import SHEET_FACES
from fastgen.programs import DECAL_KINDS, MAX_DAMAGES
from fastgen.records import check_fields, nearest
from fastgen.scene import Camera, Damage, Decal, Scene
from fastgen.sensor_config import CORNERS

MAX_DECALS = 4096
"""Rows of a texture that every driver takes several times over."""

_SHAPES = {"axis": 0, "concave": 0, "dented": 6, "perforation": 1 + 2 * LOBES}
"""How many numbers Damage.shape holds."""

_FAR = 1e6
"""Millimetres, or degrees, that no number of a sensible scene passes: the GPU counts in float32."""

_DIVISORS = {"dented": (0, 3, 5), "perforation": (0,)}
"""Which numbers of Damage.shape the field is divided by."""

_ART_KINDS = ("marker", "sticker", "emblem")
_DECAL_KINDS = tuple(kind for kind in DECAL_KINDS if kind != "stripes")
_LABELS = ("", *DETECTION_CLASSES[1:])


def check_scene(scene: Any) -> Scene:
    """`scene`, if it can be drawn. Raises ConfigError that names the first part that cannot be.

    Every field is held to its annotation and bounds in scene.py, then to what no bound expresses.
    """
    if not isinstance(scene, Scene):
        raise ConfigError(
            f"scene: {type(scene).__name__} is no Scene; take one of Generator.scene or "
            "Scene.from_json"
        )
    for name, most in (("decals", MAX_DECALS), ("damages", MAX_DAMAGES)):
        count = len(held) if isinstance(held := getattr(scene, name), tuple) else 0
        if count > most:
            raise ConfigError(f"scene.{name}: {count} are more than {most}")
    check_fields(scene, Scene, "scene", _FAR)
    _one_of(scene.container.kind, KINDS, "scene.container.kind")
    for i, camera in enumerate(scene.cameras):
        _check_camera(camera, f"scene.cameras[{i}]")
    for i, decal in enumerate(scene.decals):
        _check_decal(decal, f"scene.decals[{i}]")
    for i, damage in enumerate(scene.damages):
        _check_damage(damage, f"scene.damages[{i}]")
    for kind, count in Counter(damage.kind for damage in scene.damages).items():
        if count > MAX_INSTANCES:
            raise ConfigError(
                f"scene.damages: {count} of kind {kind}; mask values tell {MAX_INSTANCES} apart"
            )
    return scene


def check_camera(camera: Any) -> Camera:
    """`camera`, if it sees anything. Raises ConfigError that begins with 'camera'."""
    if not isinstance(camera, Camera):
        raise ConfigError(f"camera: {camera!r} is neither a Camera nor the name of one")
    check_fields(camera, Camera, "camera", _FAR)
    _check_camera(camera, "camera")
    return camera


def _one_of(name: str, known: Collection[str], path: str) -> None:
    if name not in known:
        raise ConfigError(f"{path}: {name!r} is unknown{nearest(name, known)}")


def _check_camera(camera: Camera, path: str) -> None:
    if math.dist(camera.position_mm, camera.target_mm) < 1e-3:
        raise ConfigError(f"{path}.target_mm: {camera.target_mm} is where the camera itself stands")
    if camera.sensor is not None and camera.sensor.stamp is not None:
        _one_of(camera.sensor.stamp.corner, CORNERS, f"{path}.sensor.stamp.corner")


def _check_decal(decal: Decal, path: str) -> None:
    _one_of(decal.kind, _DECAL_KINDS, f"{path}.kind")
    _one_of(decal.face, SHEET_FACES, f"{path}.face")
    _one_of(decal.class_name, _LABELS, f"{path}.class_name")
    if decal.kind == "text":
        _one_of(decal.font, glyph_tiles()[1], f"{path}.font")
        if not decal.cap_mm > 0:
            raise ConfigError(f"{path}.cap_mm: {decal.cap_mm:g} is out of range; give more than 0")
        if not decal.text.strip():
            raise ConfigError(f"{path}.lines: nothing to write")
    elif decal.kind in _ART_KINDS and decal.art != "stripes":
        _one_of(decal.art, art_images()[1], f"{path}.art")


def _check_damage(damage: Damage, path: str) -> None:
    _one_of(damage.kind, DAMAGE_CLASSES, f"{path}.kind")
    axes = (damage.along, damage.across, damage.inward)
    for i, one in enumerate(axes):
        for j, other in enumerate(axes[: i + 1]):
            if abs(sum(a * b for a, b in zip(one, other, strict=True)) - (i == j)) > 1e-3:
                raise ConfigError(
                    f"{path}.along, across, inward: are not three unit vectors at right angles"
                )
    wanted = _SHAPES[damage.kind]
    if len(damage.shape) != wanted:
        raise ConfigError(
            f"{path}.shape: a {damage.kind} has {wanted} numbers, not {len(damage.shape)}"
        )
    for i in _DIVISORS.get(damage.kind, ()):
        if not damage.shape[i] > 0:
            raise ConfigError(
                f"{path}.shape[{i}]: {damage.shape[i]!r} is out of range; give more than 0"
            )
