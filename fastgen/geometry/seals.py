"""Bolt and cable seals at the hasps of the door, as a mesh in the frame of the container.

A hasp is the catch at the end of a handle, see door_gear.py. Sizes are those of common
high-security seals (ISO 17712). A bolt has a pin of 8 mm and a barrel of 20 mm, and is 110 mm long.
The body of a cable seal measures 30 x 22 x 12 mm, and its cable is 4 mm thick. A seal has 40 to 84
triangles.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import deform
from fastgen.geometry.facets import Facets
from fastgen.geometry.mesh import Chart, Mesh, Zone
from fastgen.geometry.unfold import Patch, beside, prism, regular
from fastgen.scene import Damage, Scene, Seal
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.door_gear import hasp_mm
from fastgen.scene.limits import HASPS

Array = NDArray[np.float64]
Points = Sequence[tuple[float, float, float]]

PARTS = ("body", "steel")
"""Parts of a seal. Part p of the seal at hasp h has zone and chart number h * len(PARTS) + p."""

SEAL_ZONES = HASPS * len(PARTS)

_SPACE_MM = 20.0
"""Space between charts in the atlas."""

_NORMAL_MM = 100.0
"""Distance that counts as much as a change of one in the cosine between two normals."""

# Coordinates of parts are relative to the middle of the hasp's catch, in the plane of the castings:
# x outward, y to the right seen from outside, z up. The catch fills y from -12 to 12, z from -30 to
# 24, and x below -16. All parts are behind x = -12.5, as door gear is.

_PIN_X_MM = -25.0
_HEAD_Z_MM = (24.5, 36.0)
_BARREL_Z_MM = (-74.0, -37.0)
_CATCH_Z_MM = -29.5
_FREE_PIN_MM = -62.0
"""z of the lower end of a pin without a barrel."""

_BODY_MM = (12.0, 30.0, 22.0)
_BODY_X_MM = -20.0
_LOOP: Points = ((-22, -12, -18), (-20, -25, -30), (-20, -23, -52), (-20, -9, -68))
"""One half of a locked cable; the other half mirrors it."""

_FREE_LOOP: Points = ((-22, -12, -18), (-20, -23, -30), (-20, -21, -70), (-20, -12, -96))
_FREE_END: Points = ((-22, 12, -18), (-20, 26, -26), (-20, 38, -58))


@dataclass(frozen=True, eq=False)
class _Form:
    """One kind of seal in one state, relative to its hasp.

    Attributes:
        parts: Triangles of each of PARTS.
        middle_mm: Middle [3] of the barrel, of the head without a barrel, or of the body.
    """

    parts: tuple[Patch, ...]
    middle_mm: Array


@dataclass(frozen=True, eq=False)
class SceneSeals:
    """The seals of a scene, at hasps that its damages have moved.

    Attributes:
        mesh: All seals, in the order of Scene.seals. The only group of triangles is "door".
        facets: The same triangles; their owner is the index into Scene.seals.
        middles_mm: float64 [N, 3], middle of each seal's barrel, head or body.
    """

    mesh: Mesh
    facets: Facets
    middles_mm: Array


def scene_seals(scene: Scene) -> SceneSeals | None:
    """Return the seals of a scene, None if it has none. A seal moves as a whole with its hasp."""
    if not scene.seals:
        return None
    numbers = [seal.hasp for seal in scene.seals]
    hasps = hasps_mm(scene.container.kind, numbers, scene.damages)
    forms = [_form(seal.kind, seal.state) for seal in scene.seals]
    patches = [(seal, form.parts) for seal, form in zip(scene.seals, forms, strict=True)]
    mesh, owner = _assembled(patches, hasps)
    facets = Facets(mesh.positions_mm.astype(np.float64), owner, mesh.triangles.astype(np.int64))
    return SceneSeals(mesh, facets, hasps + [form.middle_mm for form in forms])


def seal_charts() -> tuple[tuple[Chart, ...], tuple[Zone, ...]]:
    """Return charts and zones of the seals at all hasps; those of a scene differ in their place."""
    return _charts({})


def nearest_gear(seals: Mesh, container: Mesh) -> NDArray[np.int64]:
    """Return the vertex of a container at rest that has most nearly the light of each vertex [V].

    It is near and has a similar normal, on the handle and catch of the seal's own hasp.
    """
    found = np.zeros(len(seals.positions_mm), np.int64)
    hasps = seals.zone // len(PARTS)
    for hasp in np.unique(hasps).tolist():
        gear = np.flatnonzero(container.chart == container.chart_index(f"door.handle.{hasp}"))
        own = np.flatnonzero(hasps == hasp)
        away = seals.positions_mm[own, None] - container.positions_mm[gear]
        aligned = seals.normals[own] @ container.normals[gear].T
        cost = np.linalg.norm(away, axis=2) - _NORMAL_MM * aligned
        found[own] = gear[cost.argmin(axis=1)]
    return found


def hasp_middle_mm(kind: str, hasp: int) -> Array:
    """Return the middle [3] of a hasp of an undamaged container, in the plane of its castings."""
    return np.array([KINDS[kind].length_mm / 2, *hasp_mm(hasp)])


def hasps_mm(kind: str, hasps: Sequence[int], damages: tuple[Damage, ...]) -> Array:
    """Return the middle of each hasp [N, 3] after damage, see `hasp_middle_mm`."""
    rest = np.array([hasp_middle_mm(kind, hasp) for hasp in hasps])
    on_gear = rest + (_PIN_X_MM, 0.0, 0.0)
    return np.asarray(rest + deform(damages, on_gear) - on_gear)


def _assembled(
    seals: Sequence[tuple[Seal, tuple[Patch, ...]]], hasps_mm: Array
) -> tuple[Mesh, NDArray[np.int64]]:
    """Return the mesh of seals at hasps [N, 3], and the number of the seal of each vertex."""
    placed: dict[int, Patch] = {}
    rects: dict[int, tuple[float, float, float, float]] = {}
    positions, corners, zones, owners = [], [], [], []
    x, first = 0.0, 0
    for number, ((seal, parts), hasp_at) in enumerate(zip(seals, hasps_mm, strict=True)):
        for part, patch in enumerate(parts):
            zone = seal.hasp * len(PARTS) + part
            placed[zone] = patch.at(x, 0.0)
            rects[zone] = (x, 0.0, *patch.size_mm.tolist())
            x += float(patch.size_mm[0]) + _SPACE_MM
            count = len(patch.positions_mm)
            positions.append(patch.positions_mm + hasp_at)
            corners.append(patch.triangles + first)
            zones.append(np.full(count, zone, np.uint16))
            owners.append(np.full(count, number))
            first += count
    charts, all_zones = _charts(rects)
    triangles = np.concatenate(corners).astype(np.uint32)
    patches = list(placed.values())
    mesh = Mesh(
        positions_mm=np.concatenate(positions).astype(np.float32),
        normals=np.concatenate([p.normals for p in patches]).astype(np.float32),
        atlas_mm=np.concatenate([p.sheet_mm for p in patches]).astype(np.float32),
        zone=np.concatenate(zones),
        triangles=triangles,
        charts=charts,
        zones=all_zones,
        atlas_size_mm=(x, max(height for *_, height in rects.values())),
        groups={"door": slice(0, len(triangles))},
    )
    return mesh, np.concatenate(owners)


def _charts(
    rects: dict[int, tuple[float, float, float, float]],
) -> tuple[tuple[Chart, ...], tuple[Zone, ...]]:
    charts: list[Chart] = []
    zones: list[Zone] = []
    for hasp in range(HASPS):
        for part, material in zip(PARTS, (f"seal_{hasp}", "seal_steel"), strict=True):
            rect = rects.get(len(charts), (0.0, 0.0, 1.0, 1.0))
            zones.append(Zone(len(charts), rect, 0, small=True, level=False))
            charts.append(Chart(f"door.seal.{hasp}.{part}", "door", material, rect))
    return tuple(charts), tuple(zones)


@cache
def _form(kind: str, state: str) -> _Form:
    locked = state == "locked"
    if kind == "bolt":
        head = _upright(regular((_PIN_X_MM, 0.0), 9.0, 6), _HEAD_Z_MM)
        barrel = _upright(regular((_PIN_X_MM, 0.0), 10.0, 8), _BARREL_Z_MM)
        low = _BARREL_Z_MM[1] if locked else _FREE_PIN_MM
        # nothing inside the catch, which would always count as hidden
        pin = _upright(regular((_PIN_X_MM, 0.0), 4.0, 6), (low, _CATCH_Z_MM))
        middle = sum(_BARREL_Z_MM if locked else _HEAD_Z_MM) / 2
        body = [head, barrel] if locked else [head]
        return _Form((beside(body), beside([pin])), np.array([_PIN_X_MM, 0.0, middle]))
    ends = (_LOOP, [(x, -y, z) for x, y, z in _LOOP]) if locked else (_FREE_LOOP, _FREE_END)
    lines = [_rod(a, b, 2.2) for line in ends for a, b in pairwise(line)]
    middle_mm = np.array([_BODY_X_MM, ends[0][-1][1] * (not locked), ends[0][-1][2] - 8.0])
    half = np.array(_BODY_MM) / 2
    (left, front), (right, back) = middle_mm[:2] - half[:2], middle_mm[:2] + half[:2]
    outline = np.array([(left, front), (right, front), (right, back), (left, back)])
    body = [_upright(outline, (middle_mm[2] - half[2], middle_mm[2] + half[2]))]
    return _Form((beside(body), beside(lines)), middle_mm)


def _upright(outline_mm: Array, z_mm: tuple[float, float]) -> Patch:
    return prism(outline_mm, z_mm, 2, capped=(True, True))


def _rod(start: tuple[float, ...], end: tuple[float, ...], radius_mm: float) -> Patch:
    """Return a closed rod with four sides from one point to another, not parallel to x."""
    low, high = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(high - low))
    along = (high - low) / length
    aside = np.array([1.0, 0.0, 0.0]) - along[0] * along
    aside /= np.linalg.norm(aside)
    turn = np.stack([aside, np.cross(along, aside), along])
    rod = _upright(regular((0.0, 0.0), radius_mm, 4), (0.0, length))
    return Patch(rod.positions_mm @ turn + low, rod.normals @ turn, rod.sheet_mm, rod.triangles)
