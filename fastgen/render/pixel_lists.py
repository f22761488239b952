"""Lists of pixels on the GPU, one a pixel class, for compute shaders to work off."""

from collections.abc import Sequence

import moderngl
import numpy as np

from fastgen.render.programs import LIST_BINDING, LIST_HEADER

ROOM = 1 << 21
"""Pixels that each list has room for, at most: OpenGL 4.5 promises storage blocks of 128 MiB, which
eight lists share, and dispatches of 65,535 work groups."""


class PixelLists:
    """Lists called `names` with room for all pixels of some rows of (width, height) = size images.

    rows: so many, an even number unless all. See shaders/pixel_list.glsl. Owned by Targets, which
    releases it.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], names: Sequence[str]) -> None:
        width, height = size
        self.rows = min(height, ROOM // width // 2 * 2)
        self._offsets = {name: 4 * LIST_HEADER * i for i, name in enumerate(names)}
        # of a list: three numbers of its dispatch, then its length
        self._empty = np.tile(np.array([0, 1, 1, 0], np.uint32), len(names)).tobytes()
        self._buffer = ctx.buffer(reserve=len(self._empty) + 4 * width * self.rows * len(names))

    def begin(self) -> None:
        """Empty all lists and bind them for the shaders to come."""
        self._buffer.write(self._empty)
        self._buffer.bind_to_storage_buffer(LIST_BINDING)

    def dispatch(self, name: str, program: moderngl.ComputeShader) -> None:
        """Run `program` on as many work groups as a list fills."""
        program.run_indirect(self._buffer, self._offsets[name])

    def entries(self) -> dict[str, np.ndarray]:
        """What the lists hold, uint32 [length] each, as of list_entry in the shader."""
        held = np.frombuffer(self._buffer.read(), np.uint32)
        heads = held[: LIST_HEADER * len(self._offsets)].reshape(-1, LIST_HEADER)
        lists = held[LIST_HEADER * len(self._offsets) :].reshape(len(self._offsets), -1)
        lengths = heads[:, -1].tolist()
        return {
            name: entries[:length]
            for name, entries, length in zip(self._offsets, lists, lengths, strict=True)
        }

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
