"""Indirect light on a spreader, from the container below it and from its own surfaces.

Radiosity (Goral et al. 1984, Modeling the Interaction of Light Between Diffuse Surfaces): the
irradiance of a vertex is the sum of the radiosity of visible surfaces, weighted by form factors.
Rays from the vertex determine the form factors (Wallace et al. 1989, A Ray Tracing Algorithm for
Progressive Radiosity).
"""

import hashlib
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.parallel_rays import entered, first_hits
from fastgen.geometry.solids import Body

VERSION = 2  # raise when the stored arrays change

_CELL_MM = 500.0
"""Approximate width of the container's emitting cells. The visibility of the sky on the roof below
a spreader varies over larger distances."""

_FACING = 0.7
"""Least cosine between the normal of a vertex and the side of the container's box it represents."""

_RECESS_MM = 150.0
"""Largest depth of such a vertex inside the box; corrugated walls are recessed."""

_TURNED_MM = 1000.0
"""Distance between perpendicular surfaces in the search for the nearest vertex."""

_OFF_PLANE = 20.0
"""Weight of a vertex's distance from the plane of a hit, relative to distance along the plane. The
two sides of a plate, or two plates, may be as close as the vertices of one face."""

_LEAST_KNOWN = 0.25
"""Least known share of a hemisphere by which the known part is scaled up."""

_BOUNCES = 2
"""Number of bounces. A third changes the mean FLIP of objects in bench/references by 0.0001."""

Array = NDArray[np.floating]
Numbers = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Links:
    """Sparse matrix of form factors between receivers and emitters.

    Attributes:
        receiver: int [R], receivers with any emitter.
        start: int [R], first entry of each receiver in `emitter` and `weight`.
        emitter: int [K], emitter of each form factor.
        weight: float32 [K], the form factors.
    """

    receiver: NDArray[np.intp]
    start: NDArray[np.intp]
    emitter: NDArray[np.intp]
    weight: NDArray[np.float32]

    @classmethod
    def of(cls, receiver: Numbers, emitter: Numbers, weight: Array) -> Self:
        """Sum the rays between each receiver and each emitter.

        Args:
            receiver: int [K], receiver of each ray.
            emitter: int [K], emitter that each ray hits. Pairs may occur several times.
            weight: [K], share of the ray in the cosine-weighted hemisphere of its receiver.
        """
        order = np.lexsort((emitter, receiver))
        receiver, emitter, weight = receiver[order], emitter[order], weight[order]
        new = np.diff(receiver, prepend=-1) != 0
        apart = np.flatnonzero(new | (np.diff(emitter, prepend=-1) != 0))
        return cls(
            receiver[new].astype(np.intp),
            np.flatnonzero(new[apart]),
            emitter[apart].astype(np.intp),
            np.add.reduceat(weight, apart).astype(np.float32),
        )

    def gathered(self, given: NDArray[np.float32], count: int) -> NDArray[np.float32]:
        """Return irradiance / pi [M, count] of receivers from the radiance [M, E] of emitters."""
        found = np.zeros((len(given), count), np.float32)
        for received, emitted in zip(found, given, strict=True):
            received[self.receiver] = np.add.reduceat(
                self.weight * np.take(emitted, self.emitter), self.start
            )
        return found


@dataclass(frozen=True, eq=False)
class FormFactors:
    """Form factors from the vertices of a spreader.

    Rays that are hidden and hit no front face have an unknown result; most start inside a body that
    intersects their face. The known part of the hemisphere is scaled up to the whole.

    Attributes:
        own: Form factors to other vertices of the spreader, relative to `known`.
        below: Form factors to the cells of the container, relative to `known`.
        known: [V], share of the hemisphere that is sky or a known surface.
    """

    own: Links
    below: Links
    known: NDArray[np.float32]

    def light(self, sky: Array, sun: Array, below: Array, reflectance: Array) -> Array:
        """Return irradiance / pi [V, 3] of the vertices from the sky and from other surfaces.

        Args:
            sky: Direct irradiance / pi from the sky, [V, 3].
            sun: Direct irradiance / pi from directional lights, [V, 3]. It is not in the result.
            below: Radiance of the cells of the container, [C, 3].
            reflectance: Diffuse reflectance of the vertices, [V, 3].
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
    """Return the form factors of a spreader above a container, from the disk cache if possible.

    The container is represented by the bounding box of `held`.

    Args:
        spreader: Mesh whose vertices receive light.
        body: The surface of the spreader with few triangles.
        held: Mesh of the container.
        points: [V, 3], origins of the rays in mm.
        toward: [D, 3], unit vectors spread evenly over the sphere.
        hidden: bool [V, D], whether a surface hides the sky in each direction.
    """
    box = box_of(held)
    digest = hashlib.sha256(spreader.shape_digest.encode())
    for array in (body.positions_mm, body.triangles, box, points, np.packbits(hidden)):
        digest.update(np.ascontiguousarray(array).tobytes())
    arrays = disk_cache.cached(
        "form-factors",
        VERSION,
        digest.hexdigest(),
        lambda: _packed(_computed(spreader, body, box, points, toward, hidden)),
        layout=_layout(len(points)),
    )
    own, below = (
        Links(**{field.name: arrays[f"{kind}_{field.name}"] for field in fields(Links)})
        for kind in ("own", "below")
    )
    return FormFactors(own, below, arrays["known"])


def _layout(points: int) -> disk_cache.Layout:
    links = {"receiver": "int64 R", "start": "int64 R", "emitter": "int64 K", "weight": "float32 K"}
    layout = {"known": f"float32 {points}"}
    for kind in ("own", "below"):  # each has axes of its own
        layout |= {f"{kind}_{name}": f"{kind_of}_{kind}" for name, kind_of in links.items()}
    return layout


def _packed(factors: FormFactors) -> disk_cache.Arrays:
    arrays: dict[str, NDArray[Any]] = {"known": factors.known}
    for kind in ("own", "below"):
        links = getattr(factors, kind)
        arrays |= {f"{kind}_{name}": array for name, array in vars(links).items()}
    return arrays


def _computed(
    spreader: Mesh, body: Body, box: Array, points: Array, toward: Array, hidden: NDArray[np.bool_]
) -> FormFactors:
    found = _found(spreader, body, box, points, toward, hidden)
    cosine = np.maximum(spreader.normals @ toward.T, 0)
    share = cosine / cosine.sum(axis=1, keepdims=True)
    is_known = ~hidden
    for receiver, ray, _ in found.values():
        is_known[receiver, ray] = True
    known = np.maximum((share * is_known).sum(axis=1), _LEAST_KNOWN).astype(np.float32)
    share /= known[:, None]
    own, below = (
        Links.of(receiver, emitter, share[receiver, ray])
        for receiver, ray, emitter in (found["own"], found["below"])
    )
    return FormFactors(own, below, known)


def _found(
    spreader: Mesh, body: Body, box: Array, points: Array, toward: Array, hidden: NDArray[np.bool_]
) -> dict[str, NDArray[np.int32]]:
    """Cast a ray from each vertex of the spreader in each direction in which the sky is hidden.

    Returns:
        Receiver, direction and emitter of each ray that hits, int32 [3, K]. The emitters of "own"
        are vertices of the spreader, those of "below" are cells of the container's box.
    """
    corners = body.positions_mm[body.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    corners, normals = corners[size[:, 0] > 0], (normals / np.maximum(size, 1e-9))[size[:, 0] > 0]
    facing = spreader.normals @ toward.T > 0
    own: list[NDArray[np.int32]] = []  # with the triangle that each ray hits as its emitter
    below: list[NDArray[np.int32]] = []
    places: list[Array] = []
    for number, ray in enumerate(toward):
        receiver = np.flatnonzero(hidden[:, number] & facing[:, number])
        start = points[receiver]
        # a face turned away is the inside of a body
        before = np.flatnonzero(normals @ ray < -1e-3)
        hit, own_mm = first_hits(start, ray, corners[before])
        side, box_mm = entered(start, ray, box)
        on_box = box_mm < own_mm
        on_own = ~on_box & np.isfinite(own_mm)
        own.append(_rows(receiver[on_own], number, before[hit[on_own]]))
        places.append(start[on_own] + own_mm[on_own, None] * ray)
        hit_mm = start[on_box] + box_mm[on_box, None] * ray
        below.append(_rows(receiver[on_box], number, cell_of(side[on_box], hit_mm, box)))
    receiver, ray, triangle = np.concatenate(own, axis=1)
    emitter = _representatives(np.concatenate(places), normals, triangle, spreader)
    return {
        "own": np.stack([receiver, ray, emitter]).astype(np.int32),
        "below": np.concatenate(below, axis=1),
    }


def _representatives(
    positions_mm: Array, normals: Array, triangle: Numbers, spreader: Mesh
) -> Numbers:
    """Return the vertex [K] that represents each hit: close by, of similar normal, in its plane.

    The squared distance is that of the positions, plus that of the normals scaled by _TURNED_MM,
    plus that from the plane of the hit scaled by _OFF_PLANE. The planes of hits with one normal are
    parallel, so the last term is one more coordinate, and a k-d tree for each normal finds the
    nearest vertex.

    Args:
        positions_mm: Positions of the hits, [K, 3].
        normals: Normals of all triangles, [T, 3].
        triangle: Triangle of each hit, [K].
        spreader: Mesh of the vertices.
    """
    from scipy.spatial import cKDTree  # imported late: takes 0.3 s

    # rounded, so that coplanar triangles share a tree
    distinct, group = np.unique(normals.round(6), axis=0, return_inverse=True)
    group = group[triangle]
    found = np.empty(len(positions_mm), np.int64)
    for i, normal in enumerate(distinct):
        hits = np.flatnonzero(group == i)
        if len(hits):
            tree = cKDTree(_coordinates(spreader.positions_mm, spreader.normals, normal))
            hit_normals = np.broadcast_to(normal, (len(hits), 3))
            found[hits] = tree.query(_coordinates(positions_mm[hits], hit_normals, normal))[1]
    return found


def _coordinates(positions_mm: Array, normals: Array, normal: Array) -> Array:
    """Return the coordinates [N, 7] in which `_representatives` searches for hits with a normal."""
    off = _OFF_PLANE * (positions_mm @ normal)[:, None]
    return np.concatenate([positions_mm, _TURNED_MM / 2**0.5 * normals, off], axis=-1)


def _rows(receiver: Numbers, ray: int, emitter: Numbers) -> NDArray[np.int32]:
    return np.stack([receiver, np.full(len(receiver), ray), emitter]).astype(np.int32)


def box_of(container: Mesh) -> Array:
    """Return the lowest and highest coordinates of a container, [2, 3]."""
    return np.stack(container.bounds_mm).astype(np.float64)


def _counts(box: Array) -> NDArray[np.intp]:
    """Return the number of cells along each axis, [3]."""
    counts: NDArray[np.intp] = np.ceil((box[1] - box[0]) / _CELL_MM).astype(np.intp)
    return counts


def _first_cells(box: Array) -> NDArray[np.intp]:
    """Return the first cell of each side of a box and the total number of cells, [7]."""
    x, y, z = _counts(box)
    return np.concatenate([[0], np.cumsum([y * z, y * z, x * z, x * z, x * y, x * y])])


def cell_of(side: NDArray[np.intp], points: Array, box: Array) -> NDArray[np.intp]:
    """Return the cell [K] of points [K, 3] on or near the sides [K] of the box."""
    counts = _counts(box)
    place = (points - box[0]) / (box[1] - box[0]) * counts
    at = np.clip(place.astype(np.intp), 0, counts - 1)
    axis = side // 2
    one, other = np.where(axis == 0, 1, 0), np.where(axis == 2, 1, 2)
    row = np.arange(len(at))
    cells: NDArray[np.intp] = (
        _first_cells(box)[side] + at[row, one] * counts[other] + at[row, other]
    )
    return cells


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of the bounding box of a container, and the vertices of the container in each."""

    vertices: NDArray[np.intp]
    cell: NDArray[np.intp]
    count: int

    @staticmethod
    def of(container: Mesh, held: Mesh) -> "Cells":
        """Return the cells of a container in the bounding box of `held`."""
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
        """Return the mean of vertex values [V, 3] in each cell, [C, 3]; 0 without vertices."""
        number = np.maximum(np.bincount(self.cell, minlength=self.count), 1)
        # channel by channel, because NumPy is several times slower along the last axis
        total = [
            np.bincount(self.cell, np.take(channel, self.vertices), self.count)
            for channel in values.T
        ]
        return np.stack(total, axis=1) / number[:, None]
