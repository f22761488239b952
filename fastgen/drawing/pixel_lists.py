"""Lists of pixels on the GPU, one a pixel class, for compute shaders to work off."""

from collections.abc import Sequence

import moderngl
import numpy as np

from fastgen.drawing.programs import LIST_BINDING, LIST_HEADER

_ALIGNMENT = 256
"""Bytes; no driver asks more of a storage block's offset."""


class PixelLists:
    """Room for all pixels of (width, height) = size in each of the lists called `names`.

    See shaders/pixel_list.glsl. Owned by Targets, which releases it.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], names: Sequence[str]) -> None:
        self._bytes = -(-4 * (LIST_HEADER + size[0] * size[1]) // _ALIGNMENT) * _ALIGNMENT
        self._offsets = {name: i * self._bytes for i, name in enumerate(names)}
        self._buffer = ctx.buffer(reserve=self._bytes * len(names))
        self._empty = np.array([0, 1, 1, 0], np.uint32).tobytes()

    def begin(self, name: str) -> None:
        """Empty a list and bind it for the shader that fills it."""
        self._buffer.write(self._empty, self._offsets[name])
        self._bind(name)

    def dispatch(self, name: str, program: moderngl.ComputeShader) -> None:
        """Run `program` on as many work groups as a list fills."""
        self._bind(name)
        program.run_indirect(self._buffer, self._offsets[name])

    def _bind(self, name: str) -> None:
        self._buffer.bind_to_storage_buffer(LIST_BINDING, self._offsets[name], self._bytes)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
