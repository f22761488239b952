"""Refuses scenes and cameras that cannot be drawn: those made or changed by hand, or read."""

import math
from collections import Counter
from typing import Any

import numpy as np

from fastgen.classes import DAMAGE_CLASSES, DETECTION_CLASSES
from fastgen.decals.artwork import art_images, glyph_tiles
from fastgen.errors import ConfigError
from fastgen.scene import Camera, Container, Damage, Decal, Scene
from fastgen.scene.container_kinds import KINDS, mm_away
from fastgen.scene.faces import SHEET_FACES
from fastgen.scene.limits import (
    CORNERS,
    DECAL_KINDS,
    FAR_M,
    GLYPH_RANGE,
    LOBE_LIMIT,
    LOBES,
    MAX_DAMAGES,
    MAX_INSTANCES,
    MM,
    NEAR_M,
)
from fastgen.validation import check_fields, check_known

MAX_DECALS = 4096
"""Rows of a texture that every driver takes several times over."""

_SHAPES = {"axis": 0, "concave": 0, "dented": 6, "perforation": 1 + 2 * LOBES}
"""How many numbers Damage.shape holds."""

_FAR = 1e6
"""Millimetres, or degrees, that no number of a sensible scene passes: the GPU counts in float32."""

_FARTHEST_MM = (FAR_M - 20.0) / MM
"""Of a camera from the container, so that all of that lies before the far plane."""

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
    check_known("scene.container.kind", scene.container.kind, KINDS)
    for i, camera in enumerate(scene.cameras):
        _check_camera(camera, f"scene.cameras[{i}]", scene.container)
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


def check_camera(camera: Any, container: Container) -> Camera:
    """`camera`, if it stands outside `container`. Raises ConfigError that begins with "camera"."""
    if not isinstance(camera, Camera):
        raise ConfigError(f"camera: {camera!r} is neither a Camera nor the name of one")
    check_fields(camera, Camera, "camera", _FAR)
    _check_camera(camera, "camera", container)
    return camera


def _check_camera(camera: Camera, path: str, container: Container) -> None:
    if math.dist(camera.position_mm, camera.target_mm) < 1e-3:
        raise ConfigError(f"{path}.target_mm: {camera.target_mm} is where the camera itself stands")
    away_mm = float(mm_away(np.array(camera.position_mm), container.kind))
    if away_mm < 0:
        raise ConfigError(
            f"{path}.position_mm: {camera.position_mm} is inside the container, of which only the "
            "outside is drawn"
        )
    if away_mm < NEAR_M / MM:
        raise ConfigError(
            f"{path}.position_mm: {camera.position_mm} is nearer to the container than "
            f"{NEAR_M / MM:g} mm, before which nothing is drawn; move it away"
        )
    if away_mm > _FARTHEST_MM:
        raise ConfigError(
            f"{path}.position_mm: {camera.position_mm} is {away_mm * MM:.0f} m from the container; "
            f"sight ends at {_FARTHEST_MM * MM:.0f} m, move it nearer"
        )
    if camera.sensor is not None and camera.sensor.stamp is not None:
        check_known(f"{path}.sensor.stamp.corner", camera.sensor.stamp.corner, CORNERS)


def _check_decal(decal: Decal, path: str) -> None:
    check_known(f"{path}.kind", decal.kind, _DECAL_KINDS)
    check_known(f"{path}.face", decal.face, SHEET_FACES)
    check_known(f"{path}.class_name", decal.class_name, _LABELS)
    if decal.kind == "text":
        check_known(f"{path}.font", decal.font, glyph_tiles()[1])
        if not decal.cap_mm > 0:
            raise ConfigError(f"{path}.cap_mm: {decal.cap_mm:g} is out of range; give more than 0")
        if not decal.text.strip():
            raise ConfigError(f"{path}.lines: nothing to write")
        letters = sum(char != " " for char in decal.text)
        if letters >= GLYPH_RANGE:
            raise ConfigError(f"{path}.lines: {letters} letters; give fewer than {GLYPH_RANGE}")
        for char in decal.text:
            if char != " ":
                check_known(f"{path}.lines", char, glyph_tiles()[1][decal.font].glyphs)
    if decal.kind in _ART_KINDS and decal.art != "stripes":
        check_known(f"{path}.art", decal.art, art_images()[1])
    if decal.kind == "marker" and decal.size_mm[0] != decal.size_mm[1]:
        width, height = decal.size_mm
        raise ConfigError(
            f"{path}.size_mm: a marker is a square that stands on its corner; {width:g} and "
            f"{height:g} differ"
        )


def _check_damage(damage: Damage, path: str) -> None:
    check_known(f"{path}.kind", damage.kind, DAMAGE_CLASSES)
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
    if damage.kind == "perforation":
        for i, lobe in enumerate(damage.shape[1::2]):
            if abs(lobe) > LOBE_LIMIT:
                raise ConfigError(
                    f"{path}.shape[{1 + 2 * i}]: {lobe!r} is out of range; give a lobe of "
                    f"{-LOBE_LIMIT:g} to {LOBE_LIMIT:g} of the radius"
                )
    for i in _DIVISORS.get(damage.kind, ()):
        if not damage.shape[i] > 0:
            raise ConfigError(
                f"{path}.shape[{i}]: {damage.shape[i]!r} is out of range; give more than 0"
            )
