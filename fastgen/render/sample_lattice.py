"""Sample positions of an image, and the weights of the samples in the pixel filter.

A sample is a texel of the render targets, which have S times the image's resolution along each
axis. For S > 1 the image is drawn slanted: each row of pixels starts one texel further right than
the row above. The S^2 samples of a pixel then have S^2 different horizontal positions instead of
S. This antialiases nearly vertical edges best, and most edges of a container are nearly vertical.
One sample lies exactly at each pixel's centre. shaders/sample_lattice.glsl is the GLSL twin.

The slant adds one texel of width per image row. For a square image this is a third more texels
with S = 3 and a fifth more with S = 5. The area beside the slanted image is cleared and never read.
"""

import itertools
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Offset = tuple[int, int]
"""Distance in texels to the right and down."""

LOOKUP_PX = {1: 0.92, 2: 0.6, 25: 0.2}
"""Width in pixels of one lookup of the material layers, by the number of lookups per pixel.

For a box filter; `SampleLattice.spread` scales it for wider filters. These widths come closest to
path-traced references."""

LOOKUP_PLACES = {
    1: ((0.0, 0.0),),
    2: ((0.25, 0.1), (-0.25, -0.1)),
    25: tuple(itertools.product((-0.4, -0.2, 0.0, 0.2, 0.4), repeat=2)),
}
"""Position of each lookup in pixels from the pixel's centre, for pixels that see one surface."""

SKY_PLACES = {
    1: ((-0.25, -0.25), (0.25, 0.25)),
    2: tuple(itertools.product((-0.25, 0.25), repeat=2)),
}
"""Position of each lookup of the background in pixels from the pixel's centre: for one lookup of
the material layers, and for more. With one place, lamps and windows between pixel centres flicker
as the camera moves. One lookup in a mip level would be cheaper, but its bilinear filter widens
lamps by a pixel."""

_PER_AXIS = (5, 3, 2, 1)
"""Supported numbers of samples along each axis of a pixel."""

_MOST_OF_25 = 1 << 26
"""Most texels of render targets with 25 samples per pixel; each texel takes 40 bytes."""


def fitting(most: int, size: tuple[int, int], limit: int) -> int:
    """Return the largest supported number of samples per axis whose render targets fit.

    Scenes with holes need targets of twice the height. They always have to fit, so that all images
    of one size have the same number of samples.

    Args:
        most: Upper limit of the result.
        size: Width and height of the image, pixels.
        limit: Largest width and height of a texture, texels.

    Returns:
        Samples along each axis of a pixel: 1, 2, 3 or 5. It is 1 if nothing fits, and 5 only if the
        targets also fit in memory.
    """

    def fits(n: int) -> bool:
        across, down = SampleLattice(n).texels(size)
        held = across <= limit and SampleLattice(n).inner_row(size, limit) is not None
        return held and (n < 5 or 2 * across * down <= _MOST_OF_25)

    return next((n for n in _PER_AXIS if n <= most and fits(n)), 1)


class SampleLattice:
    """Sample positions and filter for one number of samples per pixel.

    Attributes:
        per_axis: Samples along each axis of a pixel: 1, 2, 3 or 5.
        slant: Texels by which each row of pixels is shifted right relative to the row above.
        pad: Additional columns on either side that the filter reads beyond the image.
    """

    def __init__(self, per_axis: int) -> None:
        self.per_axis = per_axis
        self.slant = int(per_axis > 1)
        # An even number of samples only has one at the centre if shifted by half a sample.
        self.pad = int(per_axis == 2)
        self._border = int(per_axis == 2)

    def texels(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the size of the render targets.

        Args:
            size: Width and height of the image, pixels.

        Returns:
            Width and height, texels.
        """
        width, height = size
        across = self.per_axis * width + self.slant * (height - 1) + self._border + 2 * self.pad
        return across, self.per_axis * height + self._border

    def inner_row(self, size: tuple[int, int], limit: int) -> int | None:
        """Return the first target row of a second view of the same size, below the first view.

        With 2 samples per axis, the views share two rows if the limit requires it, for example
        with 4096 image rows and a limit of 16384. The last row of the image, and holes in its first
        row, may then be wrong.

        Args:
            size: Width and height of the image, pixels.
            limit: Largest height of a texture, texels.

        Returns:
            Row, or None if both views together do not fit.
        """
        rows = self.texels(size)[1]
        spare = max(2 * rows - limit, 0)
        return rows - spare if spare <= 2 * self._border else None

    def to_clip(self, size: tuple[int, int]) -> NDArray[np.float64]:
        """Return the matrix from the clip space of the image to that of its targets.

        Args:
            size: Width and height of the image, pixels.

        Returns:
            float64 [2, 2], to be multiplied with the column vector (x, y).
        """
        width, height = size
        across, down = self.texels(size)
        n = self.per_axis
        return np.array(
            [[n * width / across, self.slant * height / across], [0, n * height / down]]
        )

    def from_center(self, offset: Offset) -> tuple[float, float]:
        """Return the position of a sample relative to a pixel's centre.

        Args:
            offset: Distance to the sample at the centre, texels.

        Returns:
            Distance to the centre to the right and down, pixels.
        """
        right, down = offset
        y = down / self.per_axis
        return (right - self.slant * y) / self.per_axis, y

    def columns(self, region: tuple[int, int, int, int]) -> tuple[int, int]:
        """Return the target columns that the filter reads for a region and its neighbour pixels.

        Args:
            region: Left column, top row, width and height in the image, pixels.

        Returns:
            First column and the column after the last; they may lie outside the targets.
        """
        x, y, w, h = region
        n, slant = self.per_axis, self.slant
        start = self.pad + (self._border - slant) / 2
        left = n * (x - 1) + slant * (y - 1) + start
        right = n * (x + w + 1) + slant * (y + h + 1) + start
        return int(np.floor(left)), int(np.ceil(right))

    def rows(self, region: tuple[int, int, int, int]) -> tuple[int, int]:
        """Return the target rows that the filter reads for a region and its neighbour pixels.

        Args:
            region: Left column, top row, width and height in the image, pixels.

        Returns:
            First row, at least 0, and the row after the last.
        """
        _, y, _, h = region
        return max(self.per_axis * (y - 1), 0), self.per_axis * (y + h + 1) + self._border

    @cached_property
    def filter(self) -> dict[Offset, float]:
        """Weight of each sample by its offset from the pixel's centre; the weights add up to 1.

        The centre comes first, and the `near` samples come before the others. With 2 samples per
        axis the filter is a tent that reaches 0 one pixel from the centre, else a box of one pixel.
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
        """Distance in texels between the nine `near` samples."""
        return max(self.per_axis // 2, 1)

    def _is_near(self, offset: Offset) -> bool:
        return all(abs(v) <= self.step and v % self.step == 0 for v in offset)

    @property
    def near(self) -> int:
        """Number of samples, the first of `filter`, that decide if a pixel sees a single surface.

        They are nine around the centre, or the centre alone with one sample per pixel. The shader
        reads the other samples only if these differ. With 2 per axis the others are two samples
        with a weight of 1/32 each. With 5 per axis they are the 16 samples in between. In about one
        pixel in 20,000, such a sample sees a surface that no near sample sees.
        """
        return sum(map(self._is_near, self.filter))

    @property
    def spread(self) -> float:
        """Standard deviation of the filter relative to that of a box of one pixel."""
        return 2**0.5 if self.per_axis == 2 else 1.0
