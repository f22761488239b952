"""Checks that a scene or camera can be drawn, for those made or changed in Python or read."""

import math
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from fastgen.classes import ALL_DETECTION_CLASSES
from fastgen.decals.artwork import art_layers
from fastgen.decals.glyphs import font_named, glyph_tiles
from fastgen.errors import ConfigError, shown
from fastgen.scene import Camera, Damage, Decal, Neighbour, Scene
from fastgen.scene.boxes import away_mm, prop_box
from fastgen.scene.damage_kinds import form_of, kind_named
from fastgen.scene.door_gear import LIP, damaged_gear
from fastgen.scene.limits import (
    CAMERA_REACH_MM,
    COMPUTED_ART,
    GLYPH_RANGE,
    MAX_INSTANCES,
    MM,
    NEAR_M,
)
from fastgen.scene.places import check_places, container_boxes, container_names
from fastgen.validation import check_fields, check_known

_ART_KINDS = ("marker", "sticker", "triangle", "emblem")


class OwnDecals(NamedTuple):
    """Decals that a configuration adds to those of fastgen.

    Attributes:
        classes: Names of its classes.
        art: Names of its artwork.
        fonts: Names of its fonts.
    """

    classes: tuple[str, ...] = ()
    art: tuple[str, ...] = ()
    fonts: tuple[str, ...] = ()


_NONE = OwnDecals()


def check_scene(scene: Any, own: OwnDecals = _NONE) -> Scene:
    """Return a copy of a scene that can be drawn, with NumPy's numbers as Python's.

    Every field is checked against its type and bounds, then against limits that involve several
    fields.

    Args:
        scene: The scene.
        own: Decals that may occur beside those of fastgen.

    Raises:
        ConfigError: naming the first part that cannot be drawn.
    """
    if not isinstance(scene, Scene):
        raise ConfigError(
            f"scene: {type(scene).__name__} is not a Scene; take one from Generator.scene or "
            "Scene.from_json"
        )
    checked = check_fields(scene, Scene, "scene")
    _check_limits(checked, own)
    return checked


def check_camera(camera: Any, scene: Scene) -> Camera:
    """Return a copy of a camera that sees the containers of a scene from outside.

    NumPy's numbers are Python's in the copy.

    Raises:
        ConfigError: if not; the message starts with 'camera'.
    """
    if not isinstance(camera, Camera):
        raise ConfigError(f"camera: {shown(camera)} is neither a Camera nor the name of one")
    checked = check_fields(camera, Camera, "camera")
    _check_camera(checked, "camera", scene)
    return checked


def _check_limits(scene: Scene, own: OwnDecals) -> None:
    """Check limits that involve several fields."""
    carried = scene.decals or scene.damages or scene.seals or scene.spreader.present
    if not scene.container.present and carried:
        raise ConfigError(
            "scene.container.present: false, but the scene has decals, damages, seals or a "
            "spreader; remove them"
        )
    _check_contents(scene, "scene", own)
    for i, neighbour in enumerate(scene.neighbours):
        _check_contents(neighbour, f"scene.neighbours[{i}]", own)
    damages = [*scene.damages, *(damage for each in scene.neighbours for damage in each.damages)]
    for kind, count in Counter(damage.kind for damage in damages).items():
        if count > MAX_INSTANCES:
            whose = " with those of neighbours" if scene.neighbours else ""
            raise ConfigError(
                f"scene.damages: {count} of kind {kind}{whose}; mask values distinguish only "
                f"{MAX_INSTANCES}, remove some"
            )
    check_places(scene)
    for i, camera in enumerate(scene.cameras):
        _check_camera(camera, f"scene.cameras[{i}]", scene)


def _check_contents(carrier: Scene | Neighbour, path: str, own: OwnDecals) -> None:
    """Check what one container carries."""
    for hasp, count in Counter(seal.hasp for seal in carrier.seals).items():
        if count > 1:
            raise ConfigError(
                f"{path}.seals: {count} are at hasp {hasp}, and a hasp holds one; remove some"
            )
    for i, decal in enumerate(carrier.decals):
        _check_decal(decal, f"{path}.decals[{i}]", own)
    for i, damage in enumerate(carrier.damages):
        _check_damage(damage, f"{path}.damages[{i}]")
    sealed = {seal.hasp for seal in carrier.seals}
    for number, count in Counter(damaged_gear(carrier.damages)).items():
        if count > 1:
            part = "gasket of the door" if number == LIP else f"door gear of locking bar {number}"
            raise ConfigError(
                f"{path}.damages: {count} damage the {part}, which has at most one such damage; "
                "remove some"
            )
        if number in sealed:
            raise ConfigError(
                f"{path}.seals: one is at hasp {number}, but {path}.damages has a damage of its "
                "locking bar; remove one of them"
            )


def _check_camera(camera: Camera, path: str, scene: Scene) -> None:
    if math.dist(camera.position_mm, camera.target_mm) < 1e-3:
        raise ConfigError(f"{path}.target_mm: {camera.target_mm} is the camera's own position")
    place = f"{path}.position_mm: {camera.position_mm}"
    eye = np.array(camera.position_mm)
    for box, name in zip(container_boxes(scene), container_names(scene), strict=True):
        distance_mm = away_mm(box, eye)
        if distance_mm < 0:
            raise ConfigError(
                f"{place} is inside {name}; only its outside is drawn, move the camera out"
            )
        if distance_mm < NEAR_M / MM:
            raise ConfigError(
                f"{place} is nearer to {name} than {NEAR_M / MM:g} mm, where nothing is drawn; "
                "move it away"
            )
        if distance_mm > CAMERA_REACH_MM:
            raise ConfigError(
                f"{place} is {distance_mm * MM:.0f} m from {name}; sight ends at "
                f"{CAMERA_REACH_MM * MM:.0f} m, move one of them"
            )
    for i, prop in enumerate(scene.props):
        if away_mm(prop_box(prop), eye) < NEAR_M / MM:
            raise ConfigError(
                f"{place} is inside props[{i}] or nearer to it than {NEAR_M / MM:g} mm; move it "
                "away"
            )
    if scene.ground is not None and eye[2] < scene.ground.height_mm + NEAR_M / MM:
        raise ConfigError(
            f"{place} is not {NEAR_M / MM:g} mm above the ground, whose height_mm is "
            f"{scene.ground.height_mm:g}; raise it"
        )


def _check_decal(decal: Decal, path: str, own: OwnDecals) -> None:
    classes = ("", *ALL_DETECTION_CLASSES[1:], *own.classes)
    check_known(f"{path}.class_name", decal.class_name, classes)
    if decal.kind == "text":
        check_known(f"{path}.font", decal.font, {*glyph_tiles()[1], *own.fonts})
        if not decal.cap_mm > 0:
            raise ConfigError(f"{path}.cap_mm: {decal.cap_mm:g} is out of range; give more than 0")
        if not decal.text.strip():
            raise ConfigError(f"{path}.lines: the text is empty; give at least one letter")
        letters = sum(char != " " for char in decal.text)
        if letters >= GLYPH_RANGE:
            raise ConfigError(f"{path}.lines: {letters} letters; give fewer than {GLYPH_RANGE}")
        for char in decal.text:
            if char != " ":
                check_known(f"{path}.lines", char, font_named(decal.font).glyphs)
        spoken = "".join(part.text for part in decal.parts).replace(" ", "")
        if decal.parts and spoken != "".join(decal.lines).replace(" ", ""):
            raise ConfigError(
                f"{path}.parts: they read {spoken!r}, which is not the text of lines; make them "
                "agree"
            )
        for j, part in enumerate(decal.parts):
            if not part.text.strip() or (part.boxed and len(part.text) != 1):
                raise ConfigError(
                    f"{path}.parts[{j}].text: {part.text!r}; give at least one letter, and exactly "
                    "one in a box"
                )
    if decal.kind in _ART_KINDS and decal.art not in COMPUTED_ART:
        check_known(f"{path}.art", decal.art, {*art_layers(), *own.art})
    if decal.kind == "marker" and decal.size_mm[0] != decal.size_mm[1]:
        width, height = decal.size_mm
        raise ConfigError(
            f"{path}.size_mm: a marker is a square, but {width:g} and {height:g} differ; make them "
            "equal"
        )


def _check_damage(damage: Damage, path: str) -> None:
    axes = (damage.along, damage.across, damage.inward)
    for i, one in enumerate(axes):
        for j, other in enumerate(axes[: i + 1]):
            if abs(sum(a * b for a, b in zip(one, other, strict=True)) - (i == j)) > 1e-3:
                raise ConfigError(
                    f"{path}.along, across, inward: these must be three orthogonal unit vectors"
                )
    forms = [form.name for form in kind_named(damage.kind).forms]
    check_known(f"{path}.form", damage.form, forms)
    wanted = form_of(damage).parameters
    if len(damage.shape) != len(wanted):
        given = f"{len(damage.shape)} number{'s' * (len(damage.shape) != 1)}"
        numbers = f"{len(wanted)} ({'; '.join(each.name for each in wanted)}); give these"
        raise ConfigError(
            f"{path}.shape: {given}, but kind {damage.kind}, form {damage.form} has "
            f"{numbers if wanted else 'none; give an empty one'}"
        )
    for i, (value, parameter) in enumerate(zip(damage.shape, wanted, strict=True)):
        if not parameter.low <= value <= parameter.high:
            raise ConfigError(
                f"{path}.shape[{i}] ({parameter.name}): {value!r} is out of range; give "
                f"{parameter.low:g} to {parameter.high:g}"
            )
