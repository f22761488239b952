"""Light that surfaces throw on a spreader: those of the container below it, and its own.

Radiosity (Goral et al. 1984, Modeling the Interaction of Light Between Diffuse Surfaces): a vertex
gets the sum of what the surfaces it sees give off, each weighted by its form factor, which rays
cast from the vertex tell (Wallace et al. 1989, A Ray Tracing Algorithm for Progressive Radiosity).
No GL here.
"""

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import Mesh
from fastgen.light.occluders import Body

_CELL_MM = 500.0
"""The container gives off light in squares of about that width: what a spreader leaves open of its
roof changes over more."""

_FACING = 0.7
"""Least cosine to a side of the container's box of the vertices that stand for it."""

_RECESS_MM = 150.0
"""And how far within it they may lie, as corrugated walls do."""

_TURNED_MM = 1000.0
"""So far apart, for finding the vertex nearest to a place, are two surfaces at right angles."""

_OFF_PLANE = 20.0
"""And by so much counts what a vertex lies before or behind a place's plane more than what it lies
beside it: a plate's two sides, or two plates, may be as near as a face's own vertices."""

_NEAREST = 24
"""Vertices that this chooses from."""

_LEAST_KNOWN = 0.25
"""Of a hemisphere that is taken for what the rest of it looks like."""

_PARTS = 16
"""Rays are cast so many lots at a time, from left to right."""

_BOUNCES = 2
"""A third changes the FLIP of the objects in bench/references by 0.0001."""

Array = NDArray[np.floating]
Numbers = NDArray[np.integer]


class Links:
    """Form factors between receivers and emitters: a sparse matrix.

    receiver, emitter: int [K], of one ray each, so that pairs may recur. weight [K]: the ray's
    share of the receiver's cosine-weighted hemisphere.
    """

    def __init__(self, receiver: Numbers, emitter: Numbers, weight: Array) -> None:
        order = np.lexsort((emitter, receiver))
        receiver, emitter, weight = receiver[order], emitter[order], weight[order]
        new = np.diff(receiver, prepend=-1) != 0
        apart = np.flatnonzero(new | (np.diff(emitter, prepend=-1) != 0))
        self._emitter = emitter[apart].astype(np.intp)
        self._weight = np.add.reduceat(weight, apart).astype(np.float32)
        self._rows = receiver[new]
        self._starts = np.flatnonzero(new[apart])

    def gathered(self, given: NDArray[np.float32], count: int) -> NDArray[np.float32]:
        """What each of `count` receivers gets, [M, count], of what the emitters give off [M, E]."""
        found = np.zeros((len(given), count), np.float32)
        for gets, gives in zip(found, given, strict=True):
            gets[self._rows] = np.add.reduceat(
                self._weight * np.take(gives, self._emitter), self._starts
            )
        return found


@dataclass(frozen=True, eq=False)
class FormFactors:
    """What a spreader's vertices see of one another, and of the container's cells.

    known: what share [V] of its hemisphere is either or sky. Rays that are hidden and meet nothing
    from in front make up the rest: most start within a body that their face grows out of. What is
    known stands for all of it, so `own` and `below` are shares of that.
    """

    own: Links
    below: Links
    known: NDArray[np.float32]

    def light(self, sky: Array, sun: Array, below: Array, reflectance: Array) -> Array:
        """Irradiance / pi [V, 3] of the vertices by the sky and by way of surfaces.

        sky, sun: that which comes straight from either [V, 3]. below: radiance that the cells give
        off [C, 3]. reflectance: of the vertices [V, 3].
        """
        count = len(sky)
        from_sky, from_sun, cells, paint = (
            np.ascontiguousarray(values.T, np.float32) for values in (sky, sun, below, reflectance)
        )
        total = from_sky / self.known
        bounce = self.below.gathered(cells, count)
        bounce += self.own.gathered(paint * (total + from_sun), count)
        total += bounce
        for _ in range(_BOUNCES - 1):
            bounce = self.own.gathered(paint * bounce, count)
            total += bounce
        return total.T


def form_factors(
    spreader: Mesh, body: Body, held: Mesh, points: Array, toward: Array, hidden: NDArray[np.bool_]
) -> FormFactors:
    """Of a spreader above a container, for which the box around `held` stands; from the disk cache
    where they are there.

    body: the spreader's surface, of as few triangles as can be. points [V, 3]: where its vertices
    see from, in mm. toward [D, 3]: unit vectors spread evenly over the sphere. hidden [V, D]:
    whether something stands there.
    """
    box = box_of(held)
    digest = hashlib.sha256(spreader.shape_digest.encode())
    for array in (body.positions_mm, body.triangles, box, points, np.packbits(hidden)):
        digest.update(np.ascontiguousarray(array).tobytes())
    found = disk_cache.computed(
        "form-factors",
        digest.hexdigest(),
        lambda: _found(spreader, body, box, points, toward, hidden),
    )
    cosine = np.maximum(spreader.normals @ toward.T, 0)
    share = cosine / cosine.sum(axis=1, keepdims=True)
    tells = ~hidden
    for receiver, ray, _ in found.values():
        tells[receiver, ray] = True
    known = np.maximum((share * tells).sum(axis=1), _LEAST_KNOWN).astype(np.float32)
    share /= known[:, None]
    own, below = (
        Links(receiver, emitter, share[receiver, ray])
        for receiver, ray, emitter in (found["own"], found["below"])
    )
    return FormFactors(own, below, known)


def _found(
    spreader: Mesh, body: Body, box: Array, points: Array, toward: Array, hidden: NDArray[np.bool_]
) -> dict[str, NDArray[np.int32]]:
    """Receivers, rays' directions and emitters, int32 [3, K], by what the emitters are of."""
    from scipy.spatial import cKDTree  # takes 0.3 s

    tree = cKDTree(_with_normals(spreader.positions_mm, spreader.normals))
    corners = body.positions_mm[body.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    corners, normals = corners[size[:, 0] > 0], (normals / np.maximum(size, 1e-9))[size[:, 0] > 0]
    facing = spreader.normals @ toward.T > 0
    rows: dict[str, list[NDArray[np.int32]]] = {"own": [], "below": []}
    for number, ray in enumerate(toward):
        receiver = np.flatnonzero(hidden[:, number] & facing[:, number])
        start = points[receiver]
        before = normals @ ray < -1e-3  # a face turned away is the inside of something
        hit, own_mm = _first_hits(start, ray, corners[before])
        side, box_mm = _entered(start, ray, box)
        on_box = box_mm < own_mm
        on_own = ~on_box & np.isfinite(own_mm)
        met = start[on_own] + own_mm[on_own, None] * ray
        normal = normals[before][hit[on_own]]
        _, near = tree.query(_with_normals(met, normal), k=_NEAREST)
        emitter = _standing_for(met, normal, near, spreader)
        rows["own"].append(_rows(receiver[on_own], number, emitter))
        met = start[on_box] + box_mm[on_box, None] * ray
        rows["below"].append(_rows(receiver[on_box], number, cell_of(side[on_box], met, box)))
    return {name: np.concatenate(found, axis=1) for name, found in rows.items()}


def _standing_for(met: Array, normal: Array, near: Numbers, spreader: Mesh) -> Numbers:
    """Which of the vertices `near` [K, N] to places [K, 3] of surfaces with normals [K, 3] stands
    for each, [K]."""
    apart = _with_normals(met, normal)[:, None] - _with_normals(
        spreader.positions_mm[near], spreader.normals[near]
    )
    off = _OFF_PLANE * (apart[..., :3] * normal[:, None]).sum(axis=-1)
    best = ((apart**2).sum(axis=-1) + off**2).argmin(axis=1)
    return near[np.arange(len(near)), best]


def _rows(receiver: Numbers, ray: int, emitter: Numbers) -> NDArray[np.int32]:
    return np.stack([receiver, np.full(len(receiver), ray), emitter]).astype(np.int32)


def _with_normals(positions_mm: Array, normals: Array) -> Array:
    return np.concatenate([positions_mm, _TURNED_MM / 2**0.5 * normals], axis=-1)


def _first_hits(start: Array, ray: Array, corners: Array) -> tuple[NDArray[np.intp], Array]:
    """Which of triangles [T, 3, 3], all of which face a direction [3], a ray from each of N points
    meets first, and how far away; infinitely far where it meets none."""
    along = np.array([1.0, 0.0, 0.0]) - ray[0] * ray  # spreaders are long, triangles few at a place
    along /= np.linalg.norm(along)
    frame = np.stack([along, np.cross(ray, along), ray])
    at, seen = start @ frame.T, corners @ frame.T
    # which side of an edge a point is on, and how far away the plane is, are linear in its place;
    # seen from the front, which is where the rays come from, corners run the other way round
    run, rise = (np.roll(seen, -1, axis=1) - seen)[..., :2].transpose(2, 0, 1)
    edges = np.stack([-rise, run, rise * seen[..., 0] - run * seen[..., 1]])
    across = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    slope = -across[:, :2] / across[:, 2:]
    planes = np.column_stack([slope, seen[:, 0, 2] - (slope * seen[:, 0, :2]).sum(axis=1)]).T
    edges, planes = edges.astype(np.float32), planes.astype(np.float32)
    low, high = seen[..., 0].min(axis=1), seen[..., 0].max(axis=1)
    first, away = np.zeros(len(at), np.intp), np.full(len(at), np.inf)
    for part in np.array_split(np.argsort(at[:, 0]), _PARTS):
        if not len(part):
            continue
        left, right = at[part[[0, -1]], 0]
        near = np.flatnonzero((low <= right) & (high >= left))
        if not len(near):
            continue
        places = np.column_stack([at[part, :2], np.ones(len(part))]).astype(np.float32)
        outside = places @ edges[:, near, 0]
        for k in (1, 2):
            np.maximum(outside, places @ edges[:, near, k], out=outside)
        far = places @ planes[:, near] - at[part, 2:].astype(np.float32)
        far[(outside > 0) | (far <= 0)] = np.inf
        least = far.argmin(axis=1)
        first[part], away[part] = near[least], far[np.arange(len(part)), least]
    return first, away


def box_of(container: Mesh) -> Array:
    """Lowest and highest coordinates of a container, [2, 3]."""
    return np.stack(container.bounds_mm).astype(np.float64)


def _entered(start: Array, ray: Array, box: Array) -> tuple[NDArray[np.intp], Array]:
    """Through which side of a box [2, 3] a ray from each of N points outside of it gets in, and how
    far away that is; infinitely far where it misses it. 2 k is the lower side of axis k, 2 k + 1
    the upper."""
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = np.sort((box[:, None] - start) / ray, axis=0)
    axis = near.argmax(axis=1)
    entry = near.max(axis=1)
    hit = (entry > 0) & (entry < far.min(axis=1))
    return 2 * axis + (ray[axis] < 0), np.where(hit, entry, np.inf)


def _counts(box: Array) -> NDArray[np.intp]:
    """How many cells lie along each axis."""
    return np.ceil((box[1] - box[0]) / _CELL_MM).astype(np.intp)


def _first_cells(box: Array) -> NDArray[np.intp]:
    """The first cell of each side of a box, and how many there are in all, [7]."""
    x, y, z = _counts(box)
    return np.concatenate([[0], np.cumsum([y * z, y * z, x * z, x * z, x * y, x * y])])


def cell_of(side: NDArray[np.intp], points: Array, box: Array) -> NDArray[np.intp]:
    """The cell of each of K points on or near a side of the box, [K]."""
    counts = _counts(box)
    place = (points - box[0]) / (box[1] - box[0]) * counts
    at = np.clip(place.astype(np.intp), 0, counts - 1)
    axis = side // 2
    one, other = np.where(axis == 0, 1, 0), np.where(axis == 2, 1, 2)
    row = np.arange(len(at))
    return _first_cells(box)[side] + at[row, one] * counts[other] + at[row, other]


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of a container's box, and which of its vertices stand for them."""

    vertices: NDArray[np.intp]
    cell: NDArray[np.intp]
    count: int

    @staticmethod
    def of(container: Mesh, held: Mesh) -> "Cells":
        """Of a container with the box of `held`."""
        box = box_of(held)
        side = 2 * np.abs(container.normals).argmax(axis=1)
        axis = side // 2
        row = np.arange(len(axis))
        component, place = container.normals[row, axis], container.positions_mm[row, axis]
        upper = component > 0
        inward = np.where(upper, box[1, axis] - place, place - box[0, axis])
        vertices = np.flatnonzero((np.abs(component) > _FACING) & (inward < _RECESS_MM))
        side = (side + upper)[vertices]
        cell = cell_of(side, container.positions_mm[vertices].astype(np.float64), box)
        return Cells(vertices, cell, int(_first_cells(box)[-1]))

    def mean(self, values: Array) -> Array:
        """Of values [V, 3] of the container's vertices, in each cell [C, 3]; 0 where none is."""
        number = np.maximum(np.bincount(self.cell, minlength=self.count), 1)
        # channels apart: along the last axis NumPy takes several times as long
        total = [
            np.bincount(self.cell, np.take(channel, self.vertices), self.count)
            for channel in values.T
        ]
        return np.stack(total, axis=1) / number[:, None]
