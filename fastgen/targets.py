"""The framebuffers of one image size: samples of the geometry draw, and the shaded image."""

import ctypes
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import cv2
import moderngl
import numpy as np

from fastgen.errors import ContextError
from fastgen.gl import GLContext
from fastgen.pixel_lists import PixelLists
from fastgen.programs import listed_classes
from fastgen.sample import Frame
from fastgen.sample_lattice import SampleLattice

Region = tuple[int, int, int, int]
"""x, y, width and height in pixels."""

_GL_DEPTH, _GL_SCISSOR_TEST = 0x1801, 0x0C11
_FAR, _SKY = (ctypes.c_float * 1)(1.0), (ctypes.c_float * 1)(0.0)
_KEYS_FORMAT, _DEPTH_FORMAT = (0x8D94, 0x1405), (0x1902, 0x1406)
"""GL_RED_INTEGER of GL_UNSIGNED_INT, GL_DEPTH_COMPONENT of GL_FLOAT."""


def bands(regions: Sequence[Region | None]) -> list[Region | None]:
    """Disjoint regions, the upper first, that hold all of `regions`; None is the whole image.

    Each row is held from the leftmost to the rightmost column of the regions that it crosses.
    """
    known = [region for region in regions if region is not None]
    if len(known) < len(regions):
        return [None]
    found: list[Region | None] = []
    for top, bottom in pairwise(sorted({v for _, y, _, h in known for v in (y, y + h)})):
        crossed = [(x, x + w) for x, y, w, h in known if y <= top and bottom <= y + h]
        if not crossed:
            continue
        left, right = min(x for x, _ in crossed), max(x for _, x in crossed)
        last = found[-1] if found else None
        if last and (last[0], last[2]) == (left, right - left) and last[1] + last[3] == top:
            found[-1] = (left, last[1], right - left, bottom - last[1])
        else:
            found.append((left, top, right - left, bottom - top))
    return found


def merged(regions: Sequence[Region | None]) -> list[Region | None]:
    """Disjoint regions that hold all of `regions`, those that overlap within the least rectangle
    about them; None is the whole image."""
    found: list[Region] = []
    for region in regions:
        if region is None:
            return [None]
        x, y, width, height = region
        left, top, right, bottom = x, y, x + width, y + height
        while touched := [
            (a, b, w, h)
            for a, b, w, h in found
            if a < right and left < a + w and b < bottom and top < b + h
        ]:
            found = [other for other in found if other not in touched]
            left, top = min(left, *(a for a, *_ in touched)), min(top, *(t[1] for t in touched))
            right = max(right, *(a + w for a, _, w, _ in touched))
            bottom = max(bottom, *(b + h for _, b, _, h in touched))
        found.append((left, top, right - left, bottom - top))
    return list(found)


class Targets:
    """Framebuffers for (width, height) images with `samples_per_axis` squared samples a pixel.

    They lie where sample_lattice.py has them. damage: one of programs.DAMAGE_VARIANTS. Damaged
    scenes keep rest positions too; holed ones have sample targets of twice the height, for the
    inner view that shows through holes and begins at `inner_row`.
    """

    def __init__(
        self,
        gl: GLContext,
        size: tuple[int, int],
        samples_per_axis: int,
        damage: str = "sound",
    ) -> None:
        self.size = size
        ctx = gl.ctx
        self._lattice = SampleLattice(samples_per_axis)
        fine = self._lattice.texels(size)
        limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
        holed = damage == "holed"
        # at 4096 rows the two views of a holed scene overlap by two rows rather than not fit
        spare = max(2 * fine[1] - limit, 0) if holed else 0
        self.inner_row = fine[1] - (spare if spare <= 2 else 0)
        stored = (fine[0], fine[1] + self.inner_row if holed else fine[1])
        if max(stored) > limit:
            what = "a scene with holes" if holed else "a scene"
            raise ContextError(
                f"size: {size[0]}x{size[1]} with {samples_per_axis} samples along a pixel needs "
                f"textures of {max(stored)} texels for {what}, and this driver has {limit}; take a "
                "lower quality or a smaller size"
            )
        self.to_samples = self._lattice.to_clip(size)
        self.keys = ctx.texture(stored, 1, dtype="u4")
        # llvmpipe takes three times as long for four numbers a texel as for four textures of one,
        # and twice as long for bytes as for a number that holds four of them
        self.points = ctx.texture(stored, 2, dtype="f4")
        self.depths = ctx.texture(stored, 1, dtype="f4")
        self.openness = ctx.texture(stored, 1, dtype="u4")
        self.light = ctx.texture(stored, 1, dtype="u4")
        rest = 3 if damage != "sound" else 0  # x, y and z
        self.rest = [ctx.texture(stored, 1, dtype="f4") for _ in range(rest)]
        attached = [self.keys, self.points, self.depths, self.openness, self.light, *self.rest]
        for texture in attached:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = ctx.depth_texture(stored)
        self.samples = ctx.framebuffer(attached, self._depth)
        self._fine = fine
        self._buffers = [*attached, self._depth]
        self._image = [
            ctx.texture(size, 4),
            ctx.texture(size, 1, dtype="u4"),
            ctx.texture(size, 1, dtype="f4"),
        ]
        self._classes = ctx.depth_renderbuffer(size)
        self.image = ctx.framebuffer(self._image, self._classes)
        self.lists = PixelLists(ctx, size, listed_classes(samples_per_axis, damage))
        self._viewport = gl.function(
            "glViewportIndexedf", None, ctypes.c_uint, *[ctypes.c_float] * 4
        )
        self._scissor = gl.function("glScissorIndexed", None, ctypes.c_uint, *[ctypes.c_int] * 4)
        self._enable = gl.function("glEnablei", None, ctypes.c_uint, ctypes.c_uint)
        self._disable = gl.function("glDisablei", None, ctypes.c_uint, ctypes.c_uint)
        box = (ctypes.c_int,) * 7  # mip level, x, y, z, width, height, depth
        self._clear_texture = gl.function(
            "glClearTexSubImage", None, ctypes.c_uint, *box, *[ctypes.c_uint] * 2, ctypes.c_void_p
        )
        self._clear_float = gl.function(
            "glClearBufferfv", None, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
        )

    def begin_samples(
        self, seen: Sequence[Region | None], inside: Sequence[Region | None] = ()
    ) -> None:
        """Bind the sample framebuffer, emptied where it will be asked; key 0 is the void.

        seen: regions of the image, None for all of it. inside: regions that `limit_inside` will
        name.
        """
        for box in (*map(self._texels, seen), *map(self._texels_inside, inside)):
            # clearing framebuffers, llvmpipe takes four times as long, and longer for a part
            self._empty(self.keys, box, _KEYS_FORMAT, None)
            self._empty(self._depth, box, _DEPTH_FORMAT, _FAR)
        self.samples.use()
        width, height = self._fine
        self.samples.viewport = (0, 0, width, height)

    def limit_inside(self, region: Region | None) -> None:
        """Restrict the inner view to what holes in `region` of the image show, None for all."""
        width, height = self._fine
        self._viewport(1, 0.0, self.inner_row, width, height)
        self._scissor(1, *self._texels_inside(region))
        self._enable(_GL_SCISSOR_TEST, 1)

    def _texels(self, region: Region | None) -> Region:
        """The texels that pixels of `region` of the image, None for all, ask for."""
        region = region or (0, 0, *self.size)
        left, right = np.clip(self._lattice.columns(region), 0, self._fine[0]).tolist()
        top, bottom = np.clip(self._lattice.rows(region), 0, self._fine[1]).tolist()
        return left, top, right - left, bottom - top

    def _texels_inside(self, region: Region | None) -> Region:
        """As `_texels`, of the inner view: it is mirrored, and begins below the outer one."""
        left, top, width, height = self._texels(region)
        return self._fine[0] - left - width, self.inner_row + top, width, height

    def _empty(
        self, texture: moderngl.Texture, box: Region, stored_as: tuple[int, int], value: Any
    ) -> None:
        """Fill the texels of `box` with a value, None for zeros."""
        x, y, width, height = box
        self._clear_texture(texture.glo, 0, x, y, 0, width, height, 1, *stored_as, value)

    def end_samples(self) -> None:
        """Lift the restriction of the inner view."""
        self._disable(_GL_SCISSOR_TEST, 1)

    def clear_classes(self) -> None:
        """Mark all pixels of the bound image framebuffer as sky, class 0."""
        self._clear_float(_GL_DEPTH, 0, _SKY)

    def bind_images(self) -> None:
        """Let compute shaders write the colour, label and depth images, units 0 to 2."""
        for unit, texture in enumerate(self._image):
            texture.bind_to_image(unit, read=False, write=True)

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
        buffers = (*self._buffers, self._classes, *self._image)
        items: list[Any] = [self.samples, self.image, *buffers, self.lists]
        for item in items:
            item.release()
