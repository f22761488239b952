"""The framebuffers of one image size."""

import ctypes
from typing import Any

import cv2
import numpy as np

from fastgen.frame import Frame
from fastgen.render.gl import GLContext
from fastgen.render.pixel_lists import PixelLists
from fastgen.render.programs import listed_classes
from fastgen.render.sample_targets import SampleTargets
from fastgen.render.textures import FLOATS, NUMBERS, texture_clearing

_GL_R32UI = 0x8236
_GL_FRAMEBUFFER, _GL_DEPTH_ATTACHMENT, _GL_TEXTURE_2D = 0x8D40, 0x8D00, 0x0DE1


class Targets:
    """The shaded image of (width, height) = size, and the samples it is made from.

    samples_per_axis: see SampleTargets.
    """

    def __init__(self, gl: GLContext, size: tuple[int, int], samples_per_axis: int) -> None:
        self.size = size
        ctx = gl.ctx
        self.samples = SampleTargets(gl, size, samples_per_axis)
        self._image = [
            ctx.texture(size, 4),
            ctx.texture(size, 1, dtype="u4"),
            ctx.texture(size, 1, dtype="f4"),
        ]
        self.image = ctx.framebuffer(self._image)
        self._color = ctx.framebuffer(self._image[:1])
        self.lists = PixelLists(ctx, size, listed_classes(samples_per_axis))
        self._attach = gl.function(
            "glFramebufferTexture2D", None, *[ctypes.c_uint] * 4, ctypes.c_int
        )
        self._clear = texture_clearing(gl)

    def begin(self) -> bool:
        """Empty the image and bind its colour alone. Whether its depth test knows which pixels see
        sky alone: those of a depth of 1."""
        _, labels, depth = self._image
        self._clear(labels, (0, 0, *self.size), NUMBERS, 0)
        self._clear(depth, (0, 0, *self.size), FLOATS, np.inf)
        self._color.use()
        if self.samples.per_axis > 1:
            return False
        # moderngl asks that all be of one size; of holed scenes the samples' depth is higher
        tested = self.samples.depth_buffer.glo
        self._attach(_GL_FRAMEBUFFER, _GL_DEPTH_ATTACHMENT, _GL_TEXTURE_2D, tested, 0)
        return True

    def bind_images(self) -> None:
        """Let compute shaders write the colour, label and depth images, units 0 to 2, colours in
        numbers of four bytes."""
        color, labels, depth = self._image
        color.bind_to_image(0, read=False, write=True, format=_GL_R32UI)
        labels.bind_to_image(1, read=False, write=True)
        depth.bind_to_image(2, read=False, write=True)

    def read(self) -> Frame:
        """Copy the shaded image out."""
        width, height = self.size
        color = np.empty((height, width, 4), np.uint8)
        labels = np.empty((height, width), np.uint32)
        depth = np.empty((height, width), np.float32)
        self.copy_to(color, labels, depth)
        pairs = labels.view(np.uint16).reshape(height, width, 2)
        return Frame(
            # NumPy takes 20 times as long to leave a channel out
            image=np.asarray(cv2.cvtColor(color, cv2.COLOR_RGBA2RGB), np.uint8),
            cover=np.asarray(cv2.extractChannel(color, 3), np.uint8),
            ids=np.ascontiguousarray(pairs[..., 0]),
            damage=np.ascontiguousarray(pairs[..., 1]),
            depth=depth,
        )

    def copy_to(self, color: Any, labels: Any, depth: Any) -> None:
        """Copy the shaded image into writable memory or, without leaving the GPU, moderngl buffers.

        color: uint8 [H, W, 4]. labels: uint32 [H, W], id | damage << 16. depth: float32 [H, W].
        """
        self.image.read_into(color, components=4, attachment=0, alignment=1)
        self.image.read_into(labels, components=1, attachment=1, dtype="u4", alignment=1)
        self.image.read_into(depth, components=1, attachment=2, dtype="f4", alignment=1)

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [self.samples, self._color, self.image, *self._image, self.lists]
        for item in items:
            item.release()
