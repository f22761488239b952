"""Crops of the hasps of a door, with and without a seal."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.seals import hasps_mm
from fastgen.labels.crops import upright_crop
from fastgen.labels.visibility import within_visibility
from fastgen.sample import Sample
from fastgen.scene import Scene, Seal
from fastgen.scene.limits import HASPS
from fastgen.scene.object_ids import scene_numbers

LEAST_PX = 32
"""Least side of a crop. A barrel is then about 3 pixels wide."""

_ACROSS_MM = 130.0
_BELOW_MM, _ABOVE_MM = 170.0, 90.0
"""The crop around a hasp: half its width, and its reach below and above the middle of the catch."""

_DEEPEST_ASPECT = 0.4
"""Least ratio of the crop's sides in the image; a smaller one is a view along the door."""

_SHOWN = 0.85
"""Least share of the crop that shows the container."""

_SEAL_SHOWN = 0.5
"""Least visible fraction of a seal; a hasp whose seal is hidden would look like one without."""

_POINTS = 9


@dataclass(frozen=True, eq=False)
class HaspCrop:
    """One hasp in an image.

    Attributes:
        hasp: Its number, as in Seal.hasp.
        sealed: Whether a locked seal secures it. A hanging seal does not.
        pixels: uint8 [h, w, 3], 260 x 260 mm around the hasp, turned upright, with a margin of 3
            pixels.
        quad: Corners of the crop without its margin in the image, float64 [4, 2] in pixels,
            clockwise from the upper left of the door.
    """

    hasp: int
    sealed: bool
    pixels: NDArray[np.uint8]
    quad: NDArray[np.float64]


def hasp_crops(sample: Sample) -> Iterator[HaspCrop]:
    """Yield the hasps of a door that an image shows well.

    Such a hasp is inside the image, at least LEAST_PX large, not seen along the door, hardly
    occluded, and within the visibility in fog. At least half of its seal is visible, if it has one.
    """
    scene, view = sample.scene, sample.view
    if not scene.container.present:
        return
    numbers, seals = scene_numbers(scene)[0], {seal.hasp: seal for seal in scene.seals}
    fractions = {thing.id: thing.visible_fraction for thing in sample.objects}
    pixels, depth = view.project(hasp_points_mm(scene))
    within = np.logical_and(pixels >= 0, pixels < view.size)
    inside = np.asarray(within.all(axis=-1) & (depth > 0))
    columns, rows = np.moveaxis(np.floor(np.where(inside[..., None], pixels, 0)).astype(int), -1, 0)
    own = np.isin(sample.damage[rows, columns], [numbers.undamaged, *numbers.damages])
    if scene.weather.visibility_mm:
        own &= within_visibility(sample.depth, view, scene)[rows, columns]
    for hasp, quad in shown_hasps(pixels, inside, own):
        seal = seals.get(hasp)
        if seal is None or fractions[numbers.seal(seal)] >= _SEAL_SHOWN:
            yield HaspCrop(hasp, is_sealed(seal), upright_crop(sample.image, quad), quad)


def hasp_points_mm(scene: Scene) -> NDArray[np.float64]:
    """Return a grid of points over the crop of each hasp of the scene's container.

    Args:
        scene: A scene with a container.

    Returns:
        float64 [HASPS, _POINTS, _POINTS, 3] after damage, in the frame of the container: rows from
        the top, columns from the left of the door.
    """
    steps = np.linspace(0.0, 1.0, _POINTS)
    points = np.zeros((HASPS, _POINTS, _POINTS, 3))
    points[..., 1] = (2 * steps - 1) * _ACROSS_MM
    points[..., 2] = (_ABOVE_MM - steps * (_ABOVE_MM + _BELOW_MM))[:, None]
    middles = hasps_mm(scene.container.kind, range(HASPS), scene.damages)
    return np.asarray(points + middles[:, None, None])


def shown_hasps(
    pixels: NDArray[np.float64], inside: NDArray[np.bool_], shown: NDArray[np.bool_]
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield number and corners [4, 2] of the hasps whose crops are inside, large and not occluded.

    Args:
        pixels: Projected `hasp_points_mm`, [HASPS, _POINTS, _POINTS, 2].
        inside: Whether each point is inside the image, [HASPS, _POINTS, _POINTS].
        shown: Whether the image shows the container there, of the same shape.
    """
    for hasp, quad in enumerate(pixels[:, [0, 0, -1, -1], [0, -1, -1, 0]]):
        if inside[hasp].all() and shown[hasp].mean() >= _SHOWN and _large(quad):
            yield hasp, quad


def is_sealed(seal: Seal | None) -> bool:
    """Return whether a hasp with this seal, or none, is secured."""
    return seal is not None and seal.state == "locked"


def _large(quad: NDArray[np.float64]) -> bool:
    """Test whether a crop with corners [4, 2] is seen from the front, large and not slanted."""
    sides = np.roll(quad, -1, axis=0) - quad
    lengths = np.linalg.norm(sides, axis=1)
    turn = sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0]
    return bool(
        turn > 0 and lengths.min() >= LEAST_PX and lengths.min() >= _DEEPEST_ASPECT * lengths.max()
    )
