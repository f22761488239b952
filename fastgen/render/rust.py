"""Rust as shaders/rust.glsl lays it on: its constants, and what it comes to on the mean."""

from collections.abc import Iterable
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import MATERIALS, Mesh

Array = NDArray[np.floating]

EDGE_SHARE = 0.4
"""Dirt and rust come no farther in from an edge than this share of a zone's width: all of a narrow
beam would be their edge."""

SMALL_WIDE_MM, SMALL_EDGE_MM = 60.0, 15.0
"""Width of small pieces, as they wear, and the mean distance from their edges: where in a piece a
point lies is not known."""

DEFINES = {
    "RUST_REACH_MM": 90.0,  # from an edge, to where rust is 1 / e as much more likely
    "RUST_FAR": 0.6,  # share of the coverage far from edges,
    "RUST_NEAR": 3.0,  # and what is added at an edge
    "RUST_MOST": 0.9,
    "RUST_OLD": 0.35,  # of what is rusty
    "HALO": 0.3,  # deviations of the noise by which stains reach out
    "HALO_SOFTNESS": 0.25,
    "RUN_REACH_MM": 400.0,  # below an edge, to where run-off is 1 / e as much more likely
    "RUN_FAR": 1.2,
    "RUN_NEAR": 4.0,
    "RUN_MOST": 0.6,
    "RUN_SOFTNESS": 0.5,
    "STAIN_HIDES": 0.4,  # of the paint, in the channel that rust reflects most,
    "STAIN_HIDES_MOST": 0.8,  # and where it reflects nothing
    "STAIN_ALBEDO": 2.2,  # how bright a stain is, thin, beside rust
    "EDGE_SHARE": EDGE_SHARE,
    "SMALL_WIDE_MM": SMALL_WIDE_MM,
    "SMALL_EDGE_MM": SMALL_EDGE_MM,
}
"""What the shader reads of these."""

_normal_cdf = np.vectorize(NormalDist().cdf)
_normal_quantile = np.vectorize(NormalDist().inv_cdf)


def rusted(
    albedo: Array, coverage: Array, rust_albedo: Array, meshes: Iterable[Mesh]
) -> tuple[Array, Array]:
    """Of MATERIALS that had `albedo` [M, 3] the mean albedo [M, 3], under rust and what it stains,
    and the share that has gone to rust, [M, 1].

    coverage: times each material's proneness, [M, 1]; up to 0.2 that is good to 5 %, above it edges
    count for too much. rust_albedo: [3]. meshes: what is made of them. Sheet is taken for a roof's,
    the only one that throws much light on other parts.
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
    """Mean of the shader's normal_covered from `reach` below the threshold of a share."""
    return np.asarray(_normal_cdf((_normal_quantile(share) + reach) / np.hypot(1.0, softness)))


def _edges(meshes: Iterable[Mesh]) -> Array:
    """Means over each of MATERIALS, [3, M, 1]: how near it is to an edge, and to one above it where
    it is not level, as the shader falls off with either; what share is level."""
    sums = np.zeros((4, len(MATERIALS)))
    for mesh in meshes:
        sums += _edge_sums(mesh)
    area, near, below, level = sums[..., None]
    area = np.maximum(area, 1e-9)
    level[MATERIALS.index("paint_sheet")] = area[MATERIALS.index("paint_sheet")]
    return np.stack([near / area, below / np.maximum(area - level, 1e-9), level / area])


def _edge_sums(mesh: Mesh) -> Array:
    """Of each of MATERIALS, [4, M]: area, and that times what `_edges` says."""
    low, high = np.sort([zone.rect_mm[2:] for zone in mesh.zones], axis=1).T
    reach = np.minimum(DEFINES["RUST_REACH_MM"], EDGE_SHARE * low)
    # of a rectangle, 2 (low + high) - 8 d lies d from its border, up to half its width
    end = np.exp(-low / (2 * reach))
    ring = 2 * (low + high) * (1 - end) - 8 * reach * (1 - end * (1 + low / (2 * reach)))
    near = reach * ring / (low * high)
    # over the height of a zone, which is its lesser side: beams lie along
    below = DEFINES["RUN_REACH_MM"] / low * (1 - np.exp(-low / DEFINES["RUN_REACH_MM"]))
    small = [zone.small for zone in mesh.zones]
    near[small] = np.exp(-SMALL_EDGE_MM / (EDGE_SHARE * SMALL_WIDE_MM))
    below[small] = np.exp(-SMALL_EDGE_MM / DEFINES["RUN_REACH_MM"])
    level = np.array([zone.level for zone in mesh.zones], float)
    area = mesh.zone_areas_mm2
    material = [mesh.charts[zone.chart].material_index for zone in mesh.zones]
    parts = (np.ones_like(level), near, below * (1 - level), level)
    return np.array([np.bincount(material, area * part, len(MATERIALS)) for part in parts])
