"""Lists of pixels on the GPU, one a pixel class, for compute shaders to work off."""

from collections.abc import Sequence

import moderngl
import numpy as np

from fastgen.drawing.programs import LIST_BINDING, LIST_HEADER


class PixelLists:
    """Room for all pixels of (width, height) = size in each of the lists called `names`.

    See shaders/pixel_list.glsl. Owned by Targets, which releases it.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], names: Sequence[str]) -> None:
        self._offsets = {name: 4 * LIST_HEADER * i for i, name in enumerate(names)}
        # of a list: three numbers of its dispatch, then its length
        self._empty = np.tile(np.array([0, 1, 1, 0], np.uint32), len(names)).tobytes()
        room = 4 * size[0] * size[1] * len(names)
        self._buffer = ctx.buffer(reserve=len(self._empty) + room)

    def begin(self) -> None:
        """Empty all lists and bind them for the shaders to come."""
        self._buffer.write(self._empty)
        self._buffer.bind_to_storage_buffer(LIST_BINDING)

    def dispatch(self, name: str, program: moderngl.ComputeShader) -> None:
        """Run `program` on as many work groups as a list fills."""
        program.run_indirect(self._buffer, self._offsets[name])

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
