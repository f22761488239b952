"""Constants of shaders/rust.glsl, and the mean albedo of materials under rust and its stains."""

from collections.abc import Iterable
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import MATERIALS, Mesh

Array = NDArray[np.floating]

EDGE_SHARE = 0.4
"""Largest reach of dirt and rust from an edge, as a share of the zone's width.

Without this limit, all of a narrow beam would count as its edge."""

SMALL_WIDE_MM, SMALL_EDGE_MM = 60.0, 15.0
"""Assumed width of small pieces, and assumed distance of their points from an edge.

The position of a point within a small piece is unknown, because they share one zone."""

DEFINES = {
    # Share of a surface gone to rust: coverage * (FAR + NEAR * exp(-edge distance / REACH)).
    "RUST_REACH_MM": 90.0,
    "RUST_FAR": 0.6,
    "RUST_NEAR": 3.0,
    "RUST_MOST": 0.9,  # Upper limit of the share.
    "RUST_OLD": 0.35,  # Share of the rust that is old and dark.
    # Stains around rust: distance and softness in standard deviations of the noise.
    "HALO": 0.3,
    "HALO_SOFTNESS": 0.25,
    # Run-off: as for rust, with the distance below the upper edge.
    "RUN_REACH_MM": 400.0,
    "RUN_FAR": 1.2,
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

# NormalDist, because a warm start needs SciPy for nothing else and imports it slowly.
_normal_cdf = np.vectorize(NormalDist().cdf)
_normal_quantile = np.vectorize(NormalDist().inv_cdf)


def rusted(
    albedo: Array, coverage: Array, rust_albedo: Array, meshes: Iterable[Mesh]
) -> tuple[Array, Array]:
    """Return the mean albedo of each material under rust and its stains.

    All sheets are treated as roofs, because only the roof reflects much light to other parts. The
    result is within 5 % for coverages up to 0.2; above, edges have too much influence.

    Args:
        albedo: Linear albedo of each of MATERIALS without rust, [M, 3].
        coverage: Rust coverage times the proneness of each material, [M, 1].
        rust_albedo: Linear albedo of rust, [3].
        meshes: Meshes made of the materials.

    Returns:
        Mean albedo [M, 3], and the share of each material's surface gone to rust [M, 1].
    """
    c = DEFINES
    near_edge, below, level = _edges(meshes)
    share = np.clip(coverage * (c["RUST_FAR"] + c["RUST_NEAR"] * near_edge), 1e-6, c["RUST_MOST"])
    about = _spread(share, c["HALO"], c["HALO_SOFTNESS"])
    wetted = np.clip(coverage * (c["RUN_FAR"] + c["RUN_NEAR"] * below), 1e-6, c["RUN_MOST"])
    run = (1 - level) * _spread(wetted, 0.0, c["RUN_SOFTNESS"])
    stained = 1 - (1 - about) / (1 - share) * (1 - run)
    reflected = rust_albedo / max(rust_albedo.max(), 1e-4)
    hides = c["STAIN_HIDES_MOST"] + (c["STAIN_HIDES"] - c["STAIN_HIDES_MOST"]) * reflected
    stain = c["STAIN_HIDES"] * c["STAIN_ALBEDO"] * rust_albedo
    paint = (1 - stained * hides) * albedo + stained * stain
    return np.minimum((1 - share) * paint + share * rust_albedo, 0.95), share


def _spread(share: Array, reach: float, softness: float) -> Array:
    """Return the mean of the shader's `normal_covered`, `reach` below the threshold of `share`."""
    return np.asarray(_normal_cdf((_normal_quantile(share) + reach) / np.hypot(1.0, softness)))


def _edges(meshes: Iterable[Mesh]) -> Array:
    """Return [3, M, 1] with three means over each material.

    They are the shader's falloff from edges, its falloff below upper edges (over surfaces that are
    not level), and the share of level surfaces.
    """
    sums = np.zeros((4, len(MATERIALS)))
    for mesh in meshes:
        sums += _edge_sums(mesh)
    area, near, below, level = sums[..., None]
    area = np.maximum(area, 1e-9)
    level[MATERIALS.index("paint_sheet")] = area[MATERIALS.index("paint_sheet")]
    return np.stack([near / area, below / np.maximum(area - level, 1e-9), level / area])


def _edge_sums(mesh: Mesh) -> Array:
    """Return [4, M]: area of each material in mm^2, and the area times each mean of `_edges`."""
    low, high = np.sort([zone.rect_mm[2:] for zone in mesh.zones], axis=1).T
    reach = np.minimum(DEFINES["RUST_REACH_MM"], EDGE_SHARE * low)
    # Integrates the falloff over a rectangle: 2 (low + high) - 8 d is the length of the line at
    # distance d from its border, for d up to low / 2.
    end = np.exp(-low / (2 * reach))
    ring = 2 * (low + high) * (1 - end) - 8 * reach * (1 - end * (1 + low / (2 * reach)))
    near = reach * ring / (low * high)
    # Means over the shorter side, taken as the height of a zone, because most beams are horizontal.
    below = DEFINES["RUN_REACH_MM"] / low * (1 - np.exp(-low / DEFINES["RUN_REACH_MM"]))
    small = [zone.small for zone in mesh.zones]
    near[small] = np.exp(-SMALL_EDGE_MM / (EDGE_SHARE * SMALL_WIDE_MM))
    below[small] = np.exp(-SMALL_EDGE_MM / DEFINES["RUN_REACH_MM"])
    level = np.array([zone.level for zone in mesh.zones], float)
    area = mesh.zone_areas_mm2
    material = [mesh.charts[zone.chart].material_index for zone in mesh.zones]
    parts = (np.ones_like(level), near, below * (1 - level), level)
    return np.array([np.bincount(material, area * part, len(MATERIALS)) for part in parts])
