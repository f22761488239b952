"""Targets of one image size: the shaded image, and the lists of its pixels."""

import ctypes
from typing import Any

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.frame import Frame
from fastgen.render.gl import GLContext
from fastgen.render.gl_enums import GL_DEPTH_ATTACHMENT, GL_FRAMEBUFFER, GL_R32UI, GL_TEXTURE_2D
from fastgen.render.pixel_lists import PixelLists
from fastgen.render.textures import FLOATS, NUMBERS, texture_clearing
from fastgen.render.variant import PIXEL_CLASSES
from fastgen.render.visibility_buffer import VisibilityBuffer


class ImageTargets:
    """Colour, labels and depth of an image, and the lists that the passes work through.

    Attributes:
        size: (width, height) in pixels.
        radiance: The colour is exposed linear radiance in float32 instead of display colour.
        lists: Pixel lists of the compute passes.
        image: Framebuffer of colour, labels and depth.
    """

    def __init__(self, gl: GLContext, size: tuple[int, int], radiance: bool = False) -> None:
        self.size = size
        self.radiance = radiance
        self._ctx = ctx = gl.ctx
        self._image = [
            ctx.texture(size, 4, dtype="f4" if radiance else "f1"),
            ctx.texture(size, 1, dtype="u4"),
            ctx.texture(size, 1, dtype="f4"),
        ]
        self.image = ctx.framebuffer(self._image)
        self._color = ctx.framebuffer(self._image[:1])
        self._normals: moderngl.Texture | None = None
        self.lists = PixelLists(ctx, size, tuple(PIXEL_CLASSES))
        self._attach = gl.function(
            "glFramebufferTexture2D", None, *[ctypes.c_uint] * 4, ctypes.c_int
        )
        self._clear = texture_clearing(gl)

    def begin(self, samples: VisibilityBuffer, over: bool = False) -> bool:
        """Clear labels and depth, and bind the colour alone.

        Args:
            samples: The visibility buffer of the surfaces.
            over: The whole image gets a background, before any surface is drawn.

        Returns:
            Whether a depth of 1 in the bound depth buffer marks the pixels that see only sky.
        """
        _, labels, depth = self._image
        self._clear(labels, (0, 0, *self.size), NUMBERS, 0)
        self._clear(depth, (0, 0, *self.size), FLOATS, np.inf)
        self._color.use()
        if over or samples.per_axis > 1:
            return False
        # moderngl requires attachments of one size; the depth of holed scenes has more rows
        tested = samples.depth_buffer.glo
        self._attach(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, tested, 0)
        return True

    def bind_images(self, over: bool = False) -> None:
        """Let compute shaders write colour, labels and depth as images 0 to 2.

        Args:
            over: Let them read the colour as well.
        """
        color, labels, depth = self._image
        if self.radiance:
            color.bind_to_image(0, read=over, write=True)
        else:  # four bytes of display colour are stored as one number
            color.bind_to_image(0, read=over, write=True, format=GL_R32UI)
        labels.bind_to_image(1, read=False, write=True)
        depth.bind_to_image(2, read=False, write=True)

    def bind_normals(self) -> None:
        """Clear the normals, and let compute shaders write them as image 0."""
        if self._normals is None:
            self._normals = self._ctx.texture(self.size, 4, dtype="f4")
        self._normals.write(np.zeros((*self.size[::-1], 4), np.float32))
        self._normals.bind_to_image(0, read=False, write=True)

    def read(self) -> Frame:
        """Copy the image to the CPU, see `frame_of`."""
        width, height = self.size
        color = np.empty((height, width, 4), np.float32 if self.radiance else np.uint8)
        labels = np.empty((height, width), np.uint32)
        depth = np.empty((height, width), np.float32)
        self.copy_to(color, labels, depth)
        return frame_of(color, labels, depth)

    def read_normals(self) -> NDArray[np.float32]:
        """Copy the sum of the normals in each pixel, float32 [H, W, 3], in the world frame."""
        assert self._normals is not None
        width, height = self.size
        read = np.frombuffer(self._normals.read(), np.float32)
        return read.reshape(height, width, 4)[..., :3]

    def copy_to(
        self, color: Any, labels: Any, depth: Any, *, offsets: tuple[int, int, int] = (0, 0, 0)
    ) -> None:
        """Copy the image into writable memory or, without leaving the GPU, moderngl buffers.

        Args:
            color: uint8 [H, W, 4], or float32 for radiance: colour and coverage.
            labels: uint32 [H, W], id | damage << 16.
            depth: float32 [H, W] in metres.
            offsets: Position of each of the three in its memory or buffer, in bytes.
        """
        kinds = ("f4" if self.radiance else "f1", "u4", "f4")
        for number, (place, kind) in enumerate(zip((color, labels, depth), kinds, strict=True)):
            self.image.read_into(
                place,
                components=1 if number else 4,
                attachment=number,
                dtype=kind,
                alignment=1,
                write_offset=offsets[number],
            )

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [self._color, self.image, *self._image, self.lists]
        for item in [*items, *filter(None, [self._normals])]:
            item.release()


def frame_of(color: NDArray[Any], labels: NDArray[np.uint32], depth: NDArray[np.float32]) -> Frame:
    """Return the frame of an image as `ImageTargets.copy_to` gives it.

    `Frame.image` is black where the colour is radiance.

    Args:
        color: uint8 [H, W, 4], or float32 for radiance. The frame keeps no reference to it.
        labels: uint32 [H, W]. The frame keeps no reference to it.
        depth: float32 [H, W], which becomes part of the frame.
    """
    height, width = labels.shape
    pairs = labels.view(np.uint16).reshape(height, width, 2)
    # NumPy takes 20 times as long as OpenCV to drop a channel
    rgb, cover = cv2.cvtColor(color, cv2.COLOR_RGBA2RGB), cv2.extractChannel(color, 3)
    radiance = color.dtype == np.float32
    if radiance:
        image = np.zeros((height, width, 3), np.uint8)
        cover = cv2.convertScaleAbs(cover, alpha=255)
    else:
        image = np.asarray(rgb, np.uint8)
    return Frame(
        image=image,
        cover=np.asarray(cover, np.uint8),
        ids=np.ascontiguousarray(pairs[..., 0]),
        damage=np.ascontiguousarray(pairs[..., 1]),
        depth=depth,
        radiance=np.asarray(rgb, np.float32) if radiance else None,
    )
