"""Constants of shaders/rust.glsl, and the mean of its rust over meshes and materials."""

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import MATERIALS, Chart, Mesh, Zone

VERSION = 1  # raise when the stored arrays change

Array = NDArray[np.floating]
Flats = Mapping[str, tuple[tuple[float, float], ...]]

EDGE_SHARE = 0.4
"""Largest reach of dirt and rust from an edge, as a share of the zone's width.

Without this limit, all of a narrow beam would count as its edge."""

SMALL_WIDE_MM, SMALL_EDGE_MM = 60.0, 15.0
"""Assumed width of small pieces, and assumed distance of their points from an edge.

The position of a point within a small piece is unknown, because they share one zone."""

DEFINES = {
    # Share of a surface gone to rust: the rate times the sum of the weights below, see rust.glsl.
    "RUST_FAR": 0.1,  # Open panels of steep parts.
    "RUST_LEVEL": 0.5,  # Open panels of level parts, on which water stays.
    "RUST_FOLD": 0.25,  # Folds of a corrugation.
    "FOLD_REACH_MM": 20.0,
    "RUST_NEAR": 4.0,  # Edges.
    "RUST_REACH_MM": 90.0,
    "RUST_FOOT": 7.0,  # Lower edges of steep parts.
    "FOOT_REACH_MM": 110.0,
    "RUST_MOST": 0.9,  # Upper limit of the share.
    "RUST_OLD": 0.35,  # Share of the rust that is old and dark.
    "CLUMP": 4.9,  # 1 / mean of the fourth power of tone noise.
    "EDGE_CLUMP": 0.5,  # Share of the rust at edges that comes in groups.
    # Stains around rust: distance and softness in standard deviations of the noise.
    "HALO": 0.3,
    "HALO_SOFTNESS": 0.25,
    # Run-off: as for rust, with the distance below the upper edge.
    "RUN_REACH_MM": 500.0,
    "RUN_FAR": 0.5,
    "RUN_NEAR": 4.0,
    "RUN_MOST": 0.6,
    "RUN_SOFTNESS": 0.5,
    "STAIN_HIDES": 0.4,  # Share of the paint hidden in the channel that rust reflects most.
    "STAIN_HIDES_MOST": 0.8,  # The same in a channel that rust does not reflect.
    "STAIN_ALBEDO": 2.2,  # Albedo of a stain divided by that of rust.
    "EDGE_SHARE": EDGE_SHARE,
    "SMALL_WIDE_MM": SMALL_WIDE_MM,
    "SMALL_EDGE_MM": SMALL_EDGE_MM,
}
"""Constants of the shader by name."""

_NODES = 16
"""Points along each side of a zone over which means are taken; even, because zones are mirrored."""

_CLUMP_NODES = 5
"""Values of the tone noise over which means are taken."""

_FASTEST = 1e3
"""Largest rate; it rusts all places."""

_STEPS = 3.0
"""Classes of a weight per doubling. Points of one class are merged, which makes means fast."""


class _Points(NamedTuple):
    """Classes of points on a mesh with equal weights in the shader, as arrays [N].

    Attributes:
        material: Index into MATERIALS.
        area: Area of the class, mm^2.
        weight: Factor of the rate in the share of rust.
        run_weight: Factor of the rate in the share of run-off.
        level: 1 on level zones, where no water runs, else 0.
    """

    material: NDArray[np.integer]
    area: Array
    weight: Array
    run_weight: Array
    level: Array


_LAYOUT = {"material": "int64 N", **dict.fromkeys(_Points._fields[1:], "float64 N")}
"""Layout of _Points in the disk cache."""


@lru_cache(maxsize=256)
def rate_of(coverage: float, mesh: Mesh) -> float:
    """Return the shader's rust_rate at which rust covers a share of a container's sheet.

    Args:
        coverage: Share of walls, roof and doors, 0..1; rust in scrapes and dents is extra.
        mesh: Mesh of the container.
    """
    points = _points(mesh)
    sheet = points.material == MATERIALS.index("paint_sheet")
    weight, area = points.weight[sheet], points.area[sheet]
    most = DEFINES["RUST_MOST"]
    wanted = coverage * area.sum()
    low, high = 0.0, min(coverage * _FASTEST, _FASTEST)
    for _ in range(30):
        middle = 0.5 * (low + high)
        enough = (area * np.minimum(middle * weight, most)).sum() > wanted
        low, high = (low, middle) if enough else (middle, high)
    return high


def rusted(
    albedo: Array, rate: Array, rust_albedo: Array, meshes: Iterable[Mesh]
) -> tuple[Array, Array]:
    """Return the mean albedo of each material under rust and its stains.

    Sheets are averaged over their level parts, because only the roof reflects much light to other
    parts. The result is within 5 % for coverages up to 0.2.

    Args:
        albedo: Linear albedo of each of MATERIALS without rust, [M, 3].
        rate: `rate_of` the coverage, times the proneness of each material, [M, 1].
        rust_albedo: Linear albedo of rust, [3].
        meshes: Meshes made of the materials.

    Returns:
        Mean albedo [M, 3], and the share of each material's surface gone to rust [M, 1].
    """
    c = DEFINES
    points = _Points(*map(np.concatenate, zip(*map(_points, meshes), strict=True)))
    sheet = points.material == MATERIALS.index("paint_sheet")
    area = np.where(sheet & (points.level == 0), 0.0, points.area)
    rate = rate[points.material, 0]
    share = np.clip(rate * points.weight, 1e-6, c["RUST_MOST"])
    about = _spread(share, c["HALO"], c["HALO_SOFTNESS"])
    wetted = np.clip(rate * points.run_weight, 1e-6, c["RUN_MOST"])
    run = (1 - points.level) * _spread(wetted, 0.0, c["RUN_SOFTNESS"])
    # Paint that is neither rusty nor stained.
    clean = (1 - about) * (1 - run)
    sums = [
        np.bincount(points.material, area * part, len(MATERIALS))[:, None]
        for part in (np.ones_like(share), share, clean)
    ]
    share, clean = (part / np.maximum(sums[0], 1e-9) for part in sums[1:])
    stained = np.maximum(1 - share - clean, 0.0)
    reflected = rust_albedo / max(rust_albedo.max(), 1e-4)
    hides = c["STAIN_HIDES_MOST"] + (c["STAIN_HIDES"] - c["STAIN_HIDES_MOST"]) * reflected
    stain = c["STAIN_HIDES"] * c["STAIN_ALBEDO"] * rust_albedo
    mean = clean * albedo + stained * ((1 - hides) * albedo + stain) + share * rust_albedo
    return np.minimum(mean, 0.95), share


def normal_threshold(share: Array | float) -> Array:
    """Return the values that shares of a normal distribution exceed, in standard deviations.

    Abramowitz and Stegun 1964, 26.2.22.
    """
    rare = np.minimum(share, 1 - share)
    t = np.sqrt(-2 * np.log(np.maximum(rare, 1e-6)))
    quantile = t - (2.30753 + 0.27061 * t) / (1 + t * (0.99229 + 0.04481 * t))
    return np.asarray(np.where(np.less(share, 0.5), quantile, -quantile))


def _spread(share: Array, reach: float, softness: float) -> Array:
    """Return the mean of the shader's `normal_covered`, `reach` below the threshold of `share`.

    Both approximations are those of shaders/noise.glsl.
    """
    x = (reach - normal_threshold(share)) / np.hypot(1.0, softness)
    return np.asarray(1 / (1 + np.exp(-x * (1.5976 + 0.070566 * x * x))))


@lru_cache(maxsize=128)  # all containers and spreaders of a ShapeLibrary
def _points(mesh: Mesh) -> _Points:
    """Return the classes of points on a mesh, from the disk cache if possible."""
    inputs = mesh.atlas_digest, sorted(mesh.flats.items())
    stored = disk_cache.cached(
        "rust-points", VERSION, inputs, lambda: _found(mesh)._asdict(), layout=_LAYOUT
    )
    return _Points(**stored)


def _found(mesh: Mesh) -> _Points:
    found = []
    for zone, area in zip(mesh.zones, mesh.zone_areas_mm2, strict=True):
        part, weight, run_weight = _weights(zone, _fold_mean(mesh, zone))
        values = (
            mesh.charts[zone.chart].material_index,
            area * part / weight.shape[1],
            weight,
            run_weight,
            float(zone.level),
        )
        found.append([np.broadcast_to(value, weight.shape).ravel() for value in values])
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    return _merged(_Points(columns[0].astype(np.int64), *columns[1:]))


def _merged(points: _Points) -> _Points:
    """Return points with those merged whose weights are nearly equal."""
    key = 2 * points.material + points.level.astype(int)
    for weights in (points.weight, points.run_weight):
        step = np.rint(_STEPS * np.log2(weights)).astype(int)
        step -= step.min()
        key = key * (step.max() + 1) + step
    _, group = np.unique(key, return_inverse=True)
    area = np.bincount(group, points.area).astype(float)
    means = (np.bincount(group, points.area * column) / area for column in points[2:])
    material = np.zeros(len(area), np.int64)
    material[group] = points.material
    return _Points(material, area, *means)


def fold_row(chart: Chart, zone: Zone, flats: Flats) -> tuple[float, float, float]:
    """Return the corrugation of a zone as shaders/zone_point.glsl reads it.

    Args:
        chart: Chart of the zone.
        zone: The zone.
        flats: Outermost flats of each corrugated face, see Mesh.flats.

    Returns:
        Pitch, left end of a period in whose middle an outer flat lies, from the zone's left side,
        and half the width of the flat, in mm. Without a corrugation, all of the zone is a flat.
    """
    along_x = chart.material == "paint_sheet" and chart.face != "door"
    here = flats.get(chart.face, ()) if along_x else ()
    if len(here) < 2:
        return 1.0, 0.0, 1e6
    (start, end), (following, _) = here[:2]
    pitch = following - start
    return pitch, (start + end - pitch) / 2 + chart.rect_mm[0] - zone.rect_mm[0], (end - start) / 2


def _fold_mean(mesh: Mesh, zone: Zone) -> float:
    """Return the mean of the shader's closeness to folds over a zone."""
    pitch, _, half = fold_row(mesh.charts[zone.chart], zone, mesh.flats)
    if half > pitch:
        return 0.0
    reach = DEFINES["FOLD_REACH_MM"]
    inner = pitch / 2 - half
    return 2 * reach / pitch * (2 - math.exp(-half / reach) - math.exp(-inner / reach))


def _weights(zone: Zone, fold: float) -> tuple[Array, Array, Array]:
    """Return points over one zone, dense near its edges, for several values of the tone noise.

    Returns:
        Share of the zone's area [N, 1], weight and run_weight [N, _CLUMP_NODES].
    """
    c = DEFINES
    steep = float(not zone.level)
    if zone.small:
        edge, above, below = (np.array([[SMALL_EDGE_MM]]) for _ in range(3))
        narrow, part = SMALL_WIDE_MM, np.ones((1, 1))
    else:
        across, up = zone.rect_mm[2:] if zone.quarter_turns % 2 == 0 else zone.rect_mm[3:1:-1]
        # A quintic places points densely near both ends.
        t = (np.arange(_NODES) + 0.5) / _NODES
        place = t**3 * (10 - 15 * t + 6 * t * t)
        density = 30 * (t * (1 - t)) ** 2
        density /= density.mean()
        left, above = np.meshgrid(across * place[: _NODES // 2], up * place)
        part = (density[: _NODES // 2] * density[:, None]).reshape(-1, 1)
        part /= part.sum()
        left, above = left.reshape(-1, 1), above.reshape(-1, 1)
        below = up - above
        edge, narrow = np.minimum(np.minimum(above, below), left), min(across, up)
    # The sum of two uniform values about 1/2, scaled to the deviation of one, see noise.glsl.
    share = (np.arange(_CLUMP_NODES) + 0.5) / _CLUMP_NODES
    total = np.where(share < 0.5, np.sqrt(2 * share), 2 - np.sqrt(2 - 2 * share))
    clump = np.clip(0.5 + (total - 1) * np.sqrt(0.5), 0, 1) ** 4
    clump /= clump.mean()
    near = np.exp(-edge / min(c["RUST_REACH_MM"], EDGE_SHARE * narrow))
    foot = steep * np.exp(-above / min(c["FOOT_REACH_MM"], EDGE_SHARE * narrow))
    open_panel = (c["RUST_FAR"] if steep else c["RUST_LEVEL"]) + c["RUST_FOLD"] * fold
    grouped = 1 + c["EDGE_CLUMP"] * (clump - 1)
    weight = open_panel * clump + (c["RUST_NEAR"] * near + c["RUST_FOOT"] * foot) * grouped
    run = c["RUN_NEAR"] * np.exp(-below / c["RUN_REACH_MM"]) + c["RUN_FAR"] * clump
    return part, weight, run
