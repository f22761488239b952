"""Where the samples of a frame lie on its image, and with what weight they count.

Samples are texels of targets that are finer than the image by S along each axis. With more than one
a pixel the image is drawn into them slanted: each row of pixels begins a texel further right than
the one above. Samples of one pixel are then all in columns of their own, S^2 across it instead of
S, which is what upright edges ask for, and those of a container are nearly all upright; with S = 2
they interlock almost like a honeycomb's cells. One sample lies exactly on each pixel's centre.
shaders/samples.glsl is the twin of this.

Targets are wider by as many texels as the image has rows: half as many texels again for a square
one with S = 2, a third with S = 3. What lies beside the slanted image is cleared, and seen by
nobody.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Offset = tuple[int, int]
"""Texels to the right and down."""


class SampleLattice:
    """The samples of images of which each pixel has `per_axis` squared; 1, 2 or 3.

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

        2 per axis: a tent that falls to nothing one pixel to each side. 3: the pixel's square.
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
        near = sorted(found, key=lambda offset: np.hypot(*self.from_center(offset)))
        return {offset: found[offset] / total for offset in near}

    @property
    def near(self) -> int:
        """So many samples of `filter`, the first ones and none more than a texel away, decide
        whether a pixel sees a single surface. Each of a tent's four others counts for a
        thirty-second only; they are asked where the nearer ones differ."""
        return sum(weight > 1 / 32 for weight in self.filter.values())
