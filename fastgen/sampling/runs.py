"""Sampling of streaks that water leaves below things on a wall; they have no label."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fastgen.geometry.mesh import Mesh
from fastgen.sampling.colors import mixed
from fastgen.sampling.damage_spots import damage_spots
from fastgen.sampling.sheet import has_slots, tenth
from fastgen.sampling.streams import Streams
from fastgen.scene import Color, Damage, Decal, Surface
from fastgen.scene.damage_kinds import kind_named
from fastgen.scene.limits import COMPUTED_ART

_WALLS = ("front", "back", "door", "no_door")
_WIDE_ART = ("run_wide_1", "run_wide_2", "run_wide_3")
_THIN_ART = ("run_thin_1", "run_thin_2")

_FITTINGS = "marker_"
"""Begin of the names of holders and rivets, which share their place with a marker."""

_WIDE_MM = 100.0
"""Least width of a run that consists of several streaks."""

_THIN_MM = (30.0, 80.0)
"""Width of a run below the corner of a marker."""

_ELSEWHERE_MM = (30.0, 220.0)
"""Width of a run below nothing."""

_LENGTH_MM = (200.0, 900.0)
_SHORTEST_MM = 120.0

_LOWEST_MM = 40.0
"""Height above a sheet's lower border at which the longest runs end."""

_DIRTY = 0.35
"""Strength of dirt streaks from which all runs of dirt that the configuration allows are there."""

_RUSTY = 0.03
"""Coverage of rust from which all runs of rust that the configuration allows are there."""

_ELSEWHERE_RUST = 0.4
"""Probability that a run below nothing is rust."""

_DIRT: Color = (0.05, 0.045, 0.036)


class _Source(NamedTuple):
    """Place that a run begins at.

    Attributes:
        x: Middle, mm on the sheet.
        y: Upper end, mm on the sheet.
        width: Width of the run, mm.
        rust: True for rust, False for dirt.
    """

    x: float
    y: float
    width: float
    rust: bool


def sample_runs(
    share: float,
    mesh: Mesh,
    decals: Sequence[Decal],
    damages: Sequence[Damage],
    surface: Surface,
    streams: Streams,
) -> list[Decal]:
    """Sample streaks of dirt below markers and stickers, and of rust below rusty damages.

    About as many streaks are below nothing, so that a streak tells little about what is above it.

    Args:
        share: Probability of a run below each such decal or damage; less on clean containers.
        mesh: Mesh of the undamaged container.
        decals: Decals of the container.
        damages: Damages of the container.
        surface: Paint, dirt and rust of the container.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals to paint after all others.
    """
    frequency = {
        False: share * min(surface.dirt.streaks / _DIRTY, 1.0),
        True: share * min(surface.rust.coverage / _RUSTY, 1.0),
    }
    made = []
    for face in _WALLS:
        rng = streams(f"runs.{face}")
        here = [decal for decal in decals if decal.face == face]
        size = mesh.charts[mesh.chart_index(face)].rect_mm[2:]
        above: list[Decal | Damage | None] = [decal for decal in here if _sheds_water(decal)]
        above += [d for d in damages if d.face == face and _rusts(d)]
        above += [None] * (len(above) + 1)
        for thing in above:
            elsewhere = thing is None and rng.random() < _ELSEWHERE_RUST
            if rng.random() >= frequency[elsewhere or isinstance(thing, Damage)]:
                continue
            if thing is None:
                source = _anywhere(size, elsewhere, rng)
            elif isinstance(thing, Damage):
                source = _below_damage(mesh, thing)
            else:
                source = _below_decal(thing, rng)
            run = _run(face, source, surface, rng)
            if run and has_slots([run], here):
                here.append(run)
                made.append(run)
    return made


def _sheds_water(decal: Decal) -> bool:
    drawn = decal.kind in ("marker", "sticker", "triangle") and decal.art not in COMPUTED_ART
    return drawn and not decal.art.startswith(_FITTINGS)


def _below_decal(decal: Decal, rng: np.random.Generator) -> _Source:
    """Return the lower corner of a marker, or the lower edge of a sticker."""
    (x, y), (width, height) = decal.center_mm, decal.size_mm
    if decal.kind == "marker":
        return _Source(x + rng.normal(0, 8), y - 0.47 * height, rng.uniform(*_THIN_MM), False)
    return _Source(x, y - height / 2, rng.uniform(0.5, 0.9) * width, False)


def _rusts(damage: Damage) -> bool:
    return kind_named(damage.kind).leaks and damage.paint_loss > 0 and damage.fresh < 1


def _below_damage(mesh: Mesh, damage: Damage) -> _Source:
    """Return the place of a damage on its sheet."""
    (spot,) = damage_spots(mesh, (damage,))
    (x, y), (width, height) = spot.center_mm, spot.size_mm
    if damage.kind == "dented":
        width, height = 0.4 * width, 0.0
    return _Source(
        x,
        y - 0.45 * height,
        max(0.8 * width, _THIN_MM[0]),
        True,
    )


def _anywhere(size: Sequence[float], rust: bool, rng: np.random.Generator) -> _Source:
    x, y = rng.uniform(0.05, 0.95) * size[0], rng.uniform(0.3, 0.95) * size[1]
    return _Source(x, y, rng.uniform(*_ELSEWHERE_MM), rust)


def _run(face: str, source: _Source, surface: Surface, rng: np.random.Generator) -> Decal | None:
    """Return the run of a source, or None if the sheet ends just below it."""
    length = min(float(rng.uniform(*_LENGTH_MM)), source.y - _LOWEST_MM)
    drawings = _WIDE_ART if source.width > _WIDE_MM else _THIN_ART
    art = drawings[int(rng.integers(len(drawings)))]
    strength, wear = rng.uniform(0.5, 1.0), round(float(rng.uniform(0.0, 0.4)), 3)
    color = surface.rust.albedo if source.rust else _DIRT
    if length < _SHORTEST_MM:
        return None
    return Decal(
        kind="emblem",
        class_name="",
        face=face,
        center_mm=(tenth(source.x), tenth(source.y - length / 2)),
        size_mm=(tenth(source.width), tenth(length)),
        art=art,
        albedo=mixed(surface.paint.albedo, color, strength),
        wear=wear,
    )
