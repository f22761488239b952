"""Lists of pixels on the GPU, one per pixel class, that compute shaders work through."""

from collections.abc import Sequence

import moderngl
import numpy as np

from fastgen.render.constants import LIST_BINDING, LIST_HEADER
from fastgen.render.program import ShaderProgram

ROOM = 1 << 21
"""Most pixels that a list has room for. OpenGL 4.5 guarantees storage blocks of 128 MiB, which
eight lists share, and dispatches of 65,535 work groups."""


class PixelLists:
    """Pixel lists of an image, see shaders/pixel_list.glsl.

    Attributes:
        rows: Rows of pixels that the lists have room for; an even number unless it is all rows.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], names: Sequence[str]) -> None:
        width, height = size
        self.rows = min(height, ROOM // width // 2 * 2)
        self._offsets = {name: 4 * LIST_HEADER * i for i, name in enumerate(names)}
        # three numbers of the indirect dispatch, then the length
        self._empty = np.tile(np.array([0, 1, 1, 0], np.uint32), len(names)).tobytes()
        self._buffer = ctx.buffer(reserve=len(self._empty) + 4 * width * self.rows * len(names))

    def begin(self) -> None:
        """Empty all lists and bind them for the shaders."""
        self._buffer.write(self._empty)
        self._buffer.bind_to_storage_buffer(LIST_BINDING)

    def dispatch(self, name: str, program: ShaderProgram) -> None:
        """Run a program on the pixels of a list."""
        program.dispatch_indirect(self._buffer, self._offsets[name])

    def entries(self) -> dict[str, np.ndarray]:
        """Read the lists back: entries uint32 [length] by name, see list_entry in the shader."""
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
