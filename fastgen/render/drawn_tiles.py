"""Sets of tiles on the GPU, which shaders/rectangles.vert draws."""

from collections.abc import Sequence
from typing import Self

import moderngl
import numpy as np

from fastgen.render.program import ShaderProgram, Textures
from fastgen.render.textures import data_texture
from fastgen.render.tiles import Mask, Tiles


class DrawnTiles:
    """Sets of tiles of one image. A context manager: leaving it frees its texture."""

    def __init__(self, ctx: moderngl.Context, tiles: Tiles, sets: Sequence[Mask]) -> None:
        """Find the rectangles of the sets.

        Args:
            ctx: Current context.
            tiles: The grid of tiles.
            sets: Sets of tiles, bool [R, C] each.
        """
        found = [tiles.rectangles(each) for each in sets]
        self._ends = np.cumsum([0, *map(len, found)]).tolist()
        self._texture = data_texture(
            ctx, np.concatenate([*found, np.zeros((1, 4), np.int32)])[None]
        )

    def draw(
        self, number: int, program: ShaderProgram, textures: Textures, size: tuple[int, int]
    ) -> None:
        """Draw one of the sets into the bound framebuffer.

        Args:
            number: Index of the set.
            program: Program whose vertex stage is rectangles.vert.
            textures: Textures that its fragment stage reads.
            size: (width, height) of the framebuffer.
        """
        first, end = self._ends[number : number + 2]
        program.bind({**textures, "rectangles": self._texture})
        program["first_rectangle"] = first
        program["target_size"] = size
        program.draw_vertices(6 * (end - first))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._texture.release()
