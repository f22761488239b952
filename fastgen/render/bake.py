"""Material layers of a container or a spreader as textures, baked by the shading GLSL itself."""

import numbers
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.unfold import GUTTER_MM
from fastgen.render.programs import GUTTER_STEPS, link
from fastgen.render.shading import UNITS

MAX_ATLAS = 8192
"""Texels along a side that viewers can be trusted to take."""

_TILE = 1024
_COARSEST_MM = 1000.0


@dataclass(frozen=True, eq=False)
class Atlas:
    """Baked textures of one mesh; row 0 holds the highest atlas y, so lettering is upright.

    base_color: uint8 [H, W, 3], sRGB-encoded albedo. surface: uint8 [H, W, 3], as glTF 2.0 orders
    it: 255, roughness, metallic (linear). texel_mm: width of a texel on the sheet.
    """

    base_color: NDArray[np.uint8]
    surface: NDArray[np.uint8]
    texel_mm: float

    def uv(self, atlas_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Atlas points [..., 2] in mm as texture coordinates, v counted down from row 0."""
        height, width = self.base_color.shape[:2]
        u, v = np.moveaxis(np.asarray(atlas_mm, np.float64) / self.texel_mm, -1, 0)
        return np.stack([u / width, 1 - v / height], axis=-1)


def least_texel_mm(mesh: Mesh) -> float:
    """The finest texel, in hundredths of a millimetre, with which `mesh`'s atlas fits."""
    return float(np.ceil(max(mesh.atlas_size_mm) / MAX_ATLAS * 100) / 100)


def atlas_size(mesh: Mesh, texel_mm: float) -> tuple[int, int]:
    """(width, height) in texels of `mesh`'s atlas. Raises ConfigError where that is too large."""
    if not isinstance(texel_mm, numbers.Real) or not 0 < texel_mm <= _COARSEST_MM:
        raise ConfigError(
            f"texel_mm: {texel_mm} is not a size; give millimetres above 0, "
            f"at most {_COARSEST_MM:g}"
        )
    width, height = (int(np.ceil(side / texel_mm)) for side in mesh.atlas_size_mm)
    if max(width, height) > MAX_ATLAS:
        raise ConfigError(
            f"texel_mm: {texel_mm:g} makes a texture of {width}x{height} texels, over the "
            f"{MAX_ATLAS} that viewers take; give {least_texel_mm(mesh):.2f} or more for this "
            "container"
        )
    return width, height


def bake_atlas(
    ctx: moderngl.Context, mesh: Mesh, texel_mm: float, damage: str, first_zone: int = 0
) -> Atlas:
    """Bake all texels of `mesh`. The scene's textures and uniform blocks are bound already.

    damage: one of programs.DAMAGE_VARIANTS. first_zone: what the numbers of the mesh's zones
    begin with in the table of zones. Raises ConfigError where texel_mm does not fit.
    """
    width, height = atlas_size(mesh, texel_mm)
    program = link(
        ctx,
        "bake.vert",
        "bake.frag",
        UNITS,
        damage="sound" if damage == "sound" else "damaged",
        pixel_class="decal" if damage == "sound" else "damaged",
    )
    layout = np.dtype([("p", "f4", 3), ("a", "f4", 2), ("c", "u4")])
    vertices = np.empty(len(mesh.positions_mm), layout)
    vertices["p"], vertices["a"], vertices["c"] = mesh.positions_mm, mesh.atlas_mm, mesh.zone
    vertices["c"] += first_zone
    vertex_buffer = ctx.buffer(vertices.tobytes())
    index_buffer = ctx.buffer(np.ascontiguousarray(mesh.triangles, np.uint32).tobytes())
    # without damage no texel asks for its rest position
    rest = ["in_position_mm"] if damage != "sound" else []
    content = (vertex_buffer, "3f 2f 1u" if rest else "12x 2f 1u", *rest, "in_atlas_mm", "in_zone")
    array = ctx.vertex_array(program, [content], index_buffer)
    targets = [ctx.renderbuffer((_TILE, _TILE), 4) for _ in range(2)]
    depth = ctx.depth_renderbuffer((_TILE, _TILE))
    tile = ctx.framebuffer(targets, depth)

    scale = 2 / (_TILE * texel_mm)
    program["texel_mm"] = texel_mm
    program["gutter_clip"] = [tuple(shift) for shift in _gutter_texels(texel_mm) * 2 / _TILE]
    images = [np.zeros((height, width, 4), np.uint8) for _ in targets]
    tile.use()
    ctx.enable_only(moderngl.DEPTH_TEST)
    ctx.scissor = None
    for y in range(0, height, _TILE):
        for x in range(0, width, _TILE):
            tile.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            program["atlas_to_clip"] = (scale, scale, -1 - 2 * x / _TILE, -1 - 2 * y / _TILE)
            array.render(moderngl.TRIANGLES, instances=GUTTER_STEPS)
            for i, image in enumerate(images):
                data = tile.read(components=4, attachment=i, alignment=1)
                texels = np.frombuffer(data, np.uint8).reshape(_TILE, _TILE, 4)
                part = image[y : y + _TILE, x : x + _TILE]
                part[:] = texels[: part.shape[0], : part.shape[1]]
    items: list[Any] = [tile, *targets, depth, array, vertex_buffer, index_buffer, program]
    for item in items:
        item.release()

    # what no part covers is seen in coarse mip levels only
    empty = images[0][..., 3] == 0
    for image in images:
        image[empty] = np.median(image[~empty], axis=0)
    base_color, surface = (np.ascontiguousarray(image[::-1, :, :3]) for image in images)
    return Atlas(base_color, surface, texel_mm)


def _gutter_texels(texel_mm: float) -> NDArray[np.float64]:
    """Shifts [GUTTER_STEPS, 2] in texels, within half the gap between parts, nearer ones first."""
    reach = GUTTER_MM / 2 / texel_mm
    around = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
    near, far = min(1.0, reach), min(2.0, reach)
    return np.array([(0.0, 0.0), *(np.array(around) * near), *(np.array(around) * far)])
