"""BatchReadback: the images of a batch, collected on the GPU before the CPU waits for them."""

from collections.abc import Callable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.frame import Frame
from fastgen.render.draw_inputs import ImageRequest
from fastgen.render.image_targets import ImageTargets, frame_of

_MOST_IMAGES = 16
"""Images that are collected before the CPU waits. Waiting once in 16 images instead of once in each
leaves 6 % of the waits."""

_MOST_BYTES = 1 << 28
"""Largest buffer; GPUs with 2 GiB of memory have room for it. A larger image is copied without
one."""

_TEXEL = 4
"""Bytes of a pixel of the labels, of the depth, and of the colour unless it is radiance."""


class BatchReadback:
    """A buffer on the GPU for the pixels of several images. Owned by the renderer.

    The buffer grows to the largest batch and is kept.

    Args:
        ctx: Current context.
        collects: Collect the images of a batch in the buffer. Otherwise each image is copied to the
            CPU before the next one is drawn: llvmpipe draws on the CPU, which has nothing to wait
            for, and would move the pixels once more.
    """

    def __init__(self, ctx: moderngl.Context, collects: bool) -> None:
        self._ctx = ctx
        self._collects = collects
        self._buffer: moderngl.Buffer | None = None

    def read(
        self, images: Sequence[ImageRequest], draw: Callable[[int], ImageTargets]
    ) -> list[Frame]:
        """Draw images one after the other, and copy them to the CPU.

        Args:
            images: The images.
            draw: Draws the image of an index. The next call may overwrite its targets.
        """
        if len(images) == 1 or not self._collects:
            return [draw(k).read() for k in range(len(images))]
        lengths = [*map(_bytes_of, images)]
        starts = np.cumsum([0, *lengths]).tolist()
        if self._buffer is None or self._buffer.size < starts[-1]:
            self.release()
            self._buffer = self._ctx.buffer(reserve=starts[-1])
        for k, (image, start) in enumerate(zip(images, starts, strict=False)):
            labels = start + _color_bytes(image)
            offsets = start, labels, labels + _TEXEL * _pixels(image)
            draw(k).copy_to(self._buffer, self._buffer, self._buffer, offsets=offsets)
        held = np.empty(max(lengths), np.uint8)
        frames = []
        for image, start, length in zip(images, starts, lengths, strict=False):
            self._buffer.read_into(held, length, start)  # the first one waits for all images
            frames.append(_frame(image, held[:length]))
        return frames

    def release(self) -> None:
        """Free the buffer."""
        if self._buffer is not None:
            self._buffer.release()
            self._buffer = None


def chunks(images: Sequence[ImageRequest]) -> list[list[ImageRequest]]:
    """Return images in groups that one call of `BatchReadback.read` should take, in their order."""
    found: list[list[ImageRequest]] = []
    room = 0
    for image in images:
        room -= _bytes_of(image)
        if room < 0 or len(found[-1]) == _MOST_IMAGES:
            found.append([])
            room = _MOST_BYTES - _bytes_of(image)
        found[-1].append(image)
    return found


def _pixels(image: ImageRequest) -> int:
    width, height = image.view.size
    return width * height


def _color_bytes(image: ImageRequest) -> int:
    return _TEXEL * _pixels(image) * (4 if image.radiance else 1)


def _bytes_of(image: ImageRequest) -> int:
    return _color_bytes(image) + 2 * _TEXEL * _pixels(image)


def _frame(image: ImageRequest, held: NDArray[np.uint8]) -> Frame:
    """Return an image from its bytes in a buffer: colour, labels and depth."""
    size = image.view.size[::-1]
    ends = [_color_bytes(image), len(held) - _TEXEL * _pixels(image)]
    color, labels, depth = np.split(held, ends)
    return frame_of(
        color.view(np.float32 if image.radiance else np.uint8).reshape(*size, 4),
        labels.view(np.uint32).reshape(size),
        # a copy, because the next image overwrites these bytes
        depth.view(np.float32).reshape(size).copy(),
    )
