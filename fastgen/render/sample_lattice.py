"""Where the samples of a frame lie on its image, and with what weight they count.

Samples are texels of targets that are finer than the image by S along each axis. With more than one
a pixel the image is drawn into them slanted: each row of pixels begins a texel further right than
the one above. Samples of one pixel are then all in columns of their own, S^2 across it instead of
S, which is what upright edges ask for, and those of a container are nearly all upright; with S = 2
they interlock almost like a honeycomb's cells. One sample lies exactly on each pixel's centre.
shaders/samples.glsl is the twin of this.

Targets are wider by as many texels as the image has rows: a third as many texels again for a square
one with S = 3, a fifth with S = 5. What lies beside the slanted image is cleared, and seen by
nobody.
"""

import itertools
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Offset = tuple[int, int]
"""Texels to the right and down."""

LOOKUP_PX = {1: 0.92, 2: 0.6, 25: 0.2}
"""Width of each of a pixel's lookups of the layers, by how many there are, where the pixel is
filtered as a square; a wider filter asks for wider ones. Found by the distance to path-traced
references."""

LOOKUP_PLACES = {
    1: ((0.0, 0.0),),
    2: ((0.25, 0.1), (-0.25, -0.1)),
    25: tuple(itertools.product((-0.4, -0.2, 0.0, 0.2, 0.4), repeat=2)),
}
"""Where in a pixel that sees one surface they are, in pixels from its centre."""

_PER_AXIS = (5, 3, 2, 1)

_MOST_OF_25 = 1 << 26
"""Texels of targets with 25 samples a pixel, at most: they take 40 bytes each."""


def fitting(most: int, size: tuple[int, int], limit: int) -> int:
    """Samples along each axis of a pixel, no more than `most`, with which targets of images of
    `size` are no longer than `limit` texels along either side; those of scenes with holes, which
    are twice as high, included, so that all images of a size are as fine. 1 at least, and 5 only
    where memory allows."""

    def fits(n: int) -> bool:
        across, down = SampleLattice(n).texels(size)
        held = across <= limit and SampleLattice(n).inner_row(size, limit) is not None
        return held and (n < 5 or 2 * across * down <= _MOST_OF_25)

    return next((n for n in _PER_AXIS if n <= most and fits(n)), 1)


class SampleLattice:
    """The samples of images of which each pixel has `per_axis` squared; 1, 2, 3 or 5.

    slant: texels that a pixel begins to the right of the one above it. pad: columns on either side
    for what a filter asks for beyond the image.
    """

    def __init__(self, per_axis: int) -> None:
        self.per_axis = per_axis
        self.slant = int(per_axis > 1)
        # an even number of samples has none at the pixel centre unless shifted by half a sample
        self.pad = int(per_axis == 2)
        self._border = int(per_axis == 2)

    def texels(self, size: tuple[int, int]) -> tuple[int, int]:
        """Width and height of the targets of an image of `size`."""
        width, height = size
        across = self.per_axis * width + self.slant * (height - 1) + self._border + 2 * self.pad
        return across, self.per_axis * height + self._border

    def inner_row(self, size: tuple[int, int], limit: int) -> int | None:
        """Where below an image's targets those of a second one can begin, None where both are
        higher than `limit` together. They may share two rows, as at 4096 rows with S = 2 they must;
        what a hole at the top of the image shows may then be wrong in its last."""
        rows = self.texels(size)[1]
        spare = max(2 * rows - limit, 0)
        return rows - spare if spare <= 2 * self._border else None

    def to_clip(self, size: tuple[int, int]) -> NDArray[np.float64]:
        """Clip space of an image of `size` to that of its targets: x and y times this, [2, 2]."""
        width, height = size
        across, down = self.texels(size)
        n = self.per_axis
        return np.array(
            [[n * width / across, self.slant * height / across], [0, n * height / down]]
        )

    def from_center(self, offset: Offset) -> tuple[float, float]:
        """Where the sample `offset` texels from a pixel's centre lies, in pixels from there."""
        right, down = offset
        y = down / self.per_axis
        return (right - self.slant * y) / self.per_axis, y

    def columns(self, region: tuple[int, int, int, int]) -> tuple[int, int]:
        """First column of the targets, and the one after the last, that pixels of `region` and
        those beside it ask for; region: x, y, width and height."""
        x, y, w, h = region
        n, slant = self.per_axis, self.slant
        start = self.pad + (self._border - slant) / 2
        left = n * (x - 1) + slant * (y - 1) + start
        right = n * (x + w + 1) + slant * (y + h + 1) + start
        return int(np.floor(left)), int(np.ceil(right))

    def rows(self, region: tuple[int, int, int, int]) -> tuple[int, int]:
        """As `columns`, none above the first."""
        _, y, _, h = region
        return max(self.per_axis * (y - 1), 0), self.per_axis * (y + h + 1) + self._border

    @cached_property
    def filter(self) -> dict[Offset, float]:
        """Weights of the samples about a pixel's centre, which comes first; they add up to one.

        2 per axis: a tent that falls to nothing one pixel to each side. Others: the pixel's square.
        """
        reach = range(-self.per_axis, self.per_axis + 1)
        found: dict[Offset, float] = {}
        for offset in ((right, down) for down in reach for right in reach):
            x, y = map(abs, self.from_center(offset))
            if self.per_axis == 2:
                weight = max(1 - x, 0.0) * max(1 - y, 0.0)
            else:
                weight = float(max(map(abs, offset)) <= self.per_axis // 2)
            if weight > 0:
                found[offset] = weight
        total = sum(found.values())

        def order(offset: Offset) -> tuple[bool, float]:
            return not self._is_near(offset), float(np.hypot(*self.from_center(offset)))

        return {offset: found[offset] / total for offset in sorted(found, key=order)}

    @property
    def step(self) -> int:
        """Texels between the nine samples that are `near`."""
        return max(self.per_axis // 2, 1)

    def _is_near(self, offset: Offset) -> bool:
        return all(abs(v) <= self.step and v % self.step == 0 for v in offset)

    @property
    def near(self) -> int:
        """So many samples of `filter`, the first ones, decide whether a pixel sees a single
        surface: nine about its centre, or the centre alone. The others are asked where these
        differ: of a tent two that count for a thirty-second each, and of 25 those between them,
        which in a pixel of some 20,000 see what no near one does."""
        return sum(map(self._is_near, self.filter))

    @property
    def spread(self) -> float:
        """The filter's standard deviation, in those of the pixel's square."""
        return 2**0.5 if self.per_axis == 2 else 1.0
