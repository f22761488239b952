"""Parts of a kind of damage, and the kinds of fastgen and of installed packages by name.

Local coordinates of a point at rest are u along the damage, v across it and w inward, in mm from
its origin.
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen import plugins
from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    ALL_DETECTION_CLASSES,
    BUNDLED_DAMAGE_CLASSES,
    CLASS_NAME,
    DAMAGE_GROUP,
    DRAWN_DAMAGE_CLASSES,
    PACKAGE_DAMAGE_CLASSES,
    UNDAMAGED_CLASSES,
)
from fastgen.errors import ConfigError
from fastgen.scene.data import Damage, Vec3
from fastgen.scene.limits import FARTHEST, MAX_FORMS
from fastgen.scene.surface import Color

Array = NDArray[np.floating]

MOST_PARAMETERS = 11
"""Most numbers of `Damage.shape`. The shaders read 12, and the last one is `Damage.fresh`."""

LEAST = 1e-3
"""Smallest value of parameters that fields are divided by."""

STEEL = (0.42, 0.41, 0.39)
"""Linear albedo of bare steel."""


class Parameter(NamedTuple):
    """One number of `Damage.shape`.

    Attributes:
        name: What it is, with its unit.
        low: Smallest value.
        high: Largest value.
    """

    name: str
    low: float
    high: float


PHASE = Parameter("phase in radians", -FARTHEST, FARTHEST)


def millimetres(name: str, low: float = LEAST, high: float = FARTHEST) -> Parameter:
    """Return a parameter in mm."""
    return Parameter(f"{name} in mm", low, high)


def depth_span(damage: Damage) -> tuple[float, float]:
    """Return 0 and the depth of a damage, the lower one first."""
    return min(damage.depth_mm, 0.0), max(damage.depth_mm, 0.0)


def full_depth(damage: Damage) -> float:
    """Return the largest displacement of most forms, which reach their depth somewhere."""
    return abs(damage.depth_mm)


def half_size(damage: Damage) -> tuple[float, float]:
    """Return half of a damage's length and width in mm, the reach of most forms."""
    return damage.size_mm[0] / 2, damage.size_mm[1] / 2


@dataclass(frozen=True)
class Form:
    """One form of a kind of damage. It has `amount`, `marked` or both.

    A form with both moves parts out of sight, and its mask is where `marked` is True.

    Attributes:
        name: Value of `Damage.form`.
        glsl: Name in the shaders. The file `shader` defines `DamageField NAME_field(int i, vec3 q)`
            with the displacement, or `DamageMark NAME_mark(int i, vec3 q)` for forms without
            displacement, or both. Forms with a hole also have `float outside_NAME(int i, vec2 q)`.
        shader: GLSL file, the twin of `amount`, `outline` and `marked`: the name of a file of
            fastgen, or the absolute path of another file.
        amount: Function of a damage and of u, v and w [...] to the displacement along its inward
            axis [...] in mm, without the fade that keeps it off the opposite wall.
        marked: Function of a damage and of u, v and w [...] to bool [...], True where a form
            changes the surface without moving it.
        reach: Function of a damage to the distances along and across within which it acts.
        span: Function of a damage to the lowest and the highest displacement of the outermost
            sheet in mm, 0 included. They are bounds that some damages do not reach.
        largest: Function of a damage to the largest magnitude of its displacement in mm.
        outline: Function of a damage and of u and v [...] to the distance [...] in mm outside its
            hole, negative within. None for forms without a hole.
        along_edge: True for a form about a line: an edge of the container, or a part of the door
            gear. It acts up to its reach across in every direction from it, and does not fade.
        parameters: The numbers of `Damage.shape`.
        constants: Macros of the shader by name, and their GLSL text.
    """

    name: str
    glsl: str
    shader: str
    amount: Callable[[Damage, Array, Array, Array], Array] | None = None
    marked: Callable[[Damage, Array, Array, Array], NDArray[np.bool_]] | None = None
    reach: Callable[[Damage], tuple[float, float]] = half_size
    span: Callable[[Damage], tuple[float, float]] = depth_span
    largest: Callable[[Damage], float] = full_depth
    outline: Callable[[Damage, Array, Array], Array] | None = None
    along_edge: bool = False
    parameters: tuple[Parameter, ...] = ()
    constants: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a form that the renderer cannot draw."""
        if self.amount is None and self.marked is None:
            raise ConfigError(f"form {self.name}: give amount or marked")
        if self.outline is not None and self.amount is None:
            raise ConfigError(f"form {self.name}: a form with an outline, a hole, needs amount")
        if len(self.parameters) > MOST_PARAMETERS:
            raise ConfigError(
                f"form {self.name}: {len(self.parameters)} parameters; the shaders read at most "
                f"{MOST_PARAMETERS}"
            )


@dataclass(frozen=True)
class Wear:
    """Surface of a damage; see `scene.Damage` for its fields."""

    paint_loss: float = 1.0
    fresh: float = 0.0
    bare_albedo: Color = STEEL


@dataclass(frozen=True)
class SheetForm:
    """A damage of a sheet before it is placed.

    Attributes:
        size_mm: Full length along and full width across.
        depth_mm: Largest displacement, positive inward.
        shape: Further parameters of the form, see `scene.Damage`.
        turn_deg: Angle of its length against the face's horizontal.
        half_mm: Distances along and across from the origin that the displaced sheet reaches; half
            of `size_mm` if None.
        name: Form of the kind, see `scene.Damage`.
        wear: Its surface.
        place: 'anywhere' on the face, at the 'bottom', or near a 'casting'.
    """

    size_mm: tuple[float, float]
    depth_mm: float = 0.0
    shape: tuple[float, ...] = ()
    turn_deg: float = 0.0
    half_mm: tuple[float, float] | None = None
    name: str = "plain"
    wear: Wear = Wear()
    place: str = "anywhere"


@dataclass(frozen=True)
class Kind:
    """A kind of damage: a class of the damage task.

    Kinds of fastgen are modules of `fastgen.damages`. Packages offer theirs as entry points of the
    group `fastgen.damages`.

    Attributes:
        name: Name of the class.
        forms: Its forms.
        ranges: Frozen dataclass of the ranges that a configuration may change. Every field has a
            default, and the docstring describes them.
        draw: Function of `ranges`, the name of a face, its width and height in mm and a random
            generator to a damage of the sheet, which fastgen places. None for kinds with `place`.
        place: Function of `ranges`, the container's outer length, width and height in mm and a
            random generator to a placed damage. None for kinds with `draw`.
        bulge_mm: Function of `ranges` to the largest outward displacement in mm.
        leaks: Whether rust may run down below it.
        rubbed: Whether it may have a scrape beside it.
        on_gear: Whether it damages door gear: the locking bar, or the gasket between the leaves,
            that is nearest to its origin. Each has at most one such damage, and a damaged bar has
            no seal.
    """

    name: str
    forms: tuple[Form, ...]
    ranges: type
    draw: Callable[[Any, str, tuple[float, float], np.random.Generator], SheetForm] | None = None
    place: Callable[[Any, Vec3, np.random.Generator], Damage] | None = None
    bulge_mm: Callable[[Any], float] = lambda _: 0.0
    leaks: bool = False
    rubbed: bool = False
    on_gear: bool = False

    def __post_init__(self) -> None:
        """Refuse names that labels cannot have, and kinds that cannot be drawn."""
        if not re.fullmatch(CLASS_NAME, self.name) or self.name in _RESERVED:
            raise ConfigError(
                f"damage kind {self.name!r}: not a name for a new class; give letters, digits and "
                ". _ + -, and none of the names of other classes"
            )
        if not self.forms or (self.draw is None) == (self.place is None):
            raise ConfigError(f"damage kind {self.name}: give forms, and either draw or place")


_RESERVED = {*ALL_DETECTION_CLASSES, *UNDAMAGED_CLASSES}


def bundled_kind(name: str) -> Kind:
    """Return a kind of fastgen by its name, and import its module."""
    kind: Kind = import_module(f"fastgen.damages.{name}").KIND
    return kind


@cache
def kind_named(name: str) -> Kind:
    """Return a kind of fastgen or of an installed package.

    Raises:
        ConfigError: The name is unknown, or the package that offers the kind is broken.
    """
    own = {name: bundled_kind(name)} if name in BUNDLED_DAMAGE_CLASSES else {}
    if own and name not in PACKAGE_DAMAGE_CLASSES:
        return own[name]
    kind = plugins.chosen("damage.kinds", name, own, DAMAGE_GROUP, Kind)
    if kind.name != name:
        raise ConfigError(
            f"damage.kinds: the kind {name} calls itself {kind.name!r}; give both the same name"
        )
    return kind


def form_of(damage: Damage) -> Form:
    """Return the form of a damage."""
    return next(form for form in kind_named(damage.kind).forms if form.name == damage.form)


def program_kinds(kinds: Collection[str]) -> tuple[str, ...]:
    """Return the kinds of a program that draws these kinds, in the order of classes."""
    wanted = {*DRAWN_DAMAGE_CLASSES, *kinds}
    return tuple(name for name in ALL_DAMAGE_CLASSES if name in wanted)


@cache
def forms_of(kinds: tuple[str, ...]) -> tuple[Form, ...]:
    """Return the forms of some kinds in the order in which the shaders go through them.

    Forms with holes come first, those without displacement last. Otherwise later kinds come first,
    so that they cover earlier ones.

    Raises:
        ConfigError: There are too many, or two have the same name in the shaders.
    """
    forms = [form for name in reversed(kinds) for form in kind_named(name).forms]
    if len(forms) > MAX_FORMS:
        raise ConfigError(
            f"damage.kinds: {', '.join(kinds)} have {len(forms)} forms; the renderer draws at most "
            f"{MAX_FORMS}, list fewer kinds"
        )
    names = [form.glsl for form in forms]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(
                f"damage.kinds: two forms of {', '.join(kinds)} are called {name} in the shaders; "
                "rename one or list only one of the kinds"
            )
    return tuple(sorted(forms, key=lambda form: 2 * bool(form.marked) + (form.outline is None)))
