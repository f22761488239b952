"""Bake pass: the material layers of meshes and of the ground as textures, by the shading GLSL."""

import numbers
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DRAWN_DAMAGE_CLASSES
from fastgen.errors import ConfigError
from fastgen.geometry.atlas_packing import GUTTER_MM
from fastgen.geometry.mesh import Mesh
from fastgen.render.constants import GUTTER_STEPS
from fastgen.render.program import Programs, ShaderProgram, Textures
from fastgen.render.variant import ShaderVariant

MAX_ATLAS = 8192
"""Texels along a side that viewers accept reliably."""

GROUND_TEXELS = 4096
"""Most texels along a side of the ground."""

_TILE = 1024
_COARSEST_MM = 1000.0


@dataclass(frozen=True, eq=False)
class Atlas:
    """Baked textures of one mesh or of the ground.

    Row 0 holds the highest atlas y, so lettering is upright. The ground's atlas is centred on the
    world's origin.

    Attributes:
        base_color: uint8 [H, W, 3], sRGB-encoded albedo.
        surface: uint8 [H, W, 3], linear, in the order of glTF 2.0: 255, roughness, metallic.
        texel_mm: Width of a texel on the sheet.
    """

    base_color: NDArray[np.uint8]
    surface: NDArray[np.uint8]
    texel_mm: float

    def uv(self, atlas_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return texture coordinates of atlas points [..., 2] in mm; v counts down from row 0."""
        height, width = self.base_color.shape[:2]
        u, v = np.moveaxis(np.asarray(atlas_mm, np.float64) / self.texel_mm, -1, 0)
        return np.stack([u / width, 1 - v / height], axis=-1)


def least_texel_mm(mesh: Mesh) -> float:
    """Return the smallest texel width with which a mesh's atlas fits, rounded up to 0.01 mm."""
    return float(np.ceil(max(mesh.atlas_size_mm) / MAX_ATLAS * 100) / 100)


def atlas_size(mesh: Mesh, texel_mm: float) -> tuple[int, int]:
    """Return (width, height) in texels of a mesh's atlas.

    Raises:
        ConfigError: `texel_mm` is out of range, or makes the atlas larger than MAX_ATLAS.
    """
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
    ctx: moderngl.Context,
    program: ShaderProgram,
    textures: Textures,
    mesh: Mesh,
    texel_mm: float,
    first_zone: int = 0,
) -> Atlas:
    """Bake all texels of a mesh. The uniform blocks of its scene are filled already.

    Args:
        ctx: Current context.
        program: What `bake_program` returns.
        textures: Textures of the scene's material.
        mesh: Container or spreader at rest.
        texel_mm: Width of a texel on the sheet.
        first_zone: Number of the mesh's first zone in the zone table.

    Raises:
        ConfigError: `texel_mm` is out of range, or makes the atlas larger than MAX_ATLAS.
    """
    width, height = atlas_size(mesh, texel_mm)
    linked = program.linked
    assert isinstance(linked, moderngl.Program)
    layout = np.dtype([("p", "f4", 3), ("a", "f4", 2), ("c", "u4")])
    vertices = np.empty(len(mesh.positions_mm), layout)
    vertices["p"], vertices["a"], vertices["c"] = mesh.positions_mm, mesh.atlas_mm, mesh.zone
    vertices["c"] += first_zone
    vertex_buffer = ctx.buffer(vertices.tobytes())
    index_buffer = ctx.buffer(np.ascontiguousarray(mesh.triangles, np.uint32).tobytes())
    # without damage the program reads no rest position
    rest = ["in_position_mm"] if "in_position_mm" in linked else []
    content = (vertex_buffer, "3f 2f 1u" if rest else "12x 2f 1u", *rest, "in_atlas_mm", "in_zone")
    array = ctx.vertex_array(linked, [content], index_buffer)
    targets = [ctx.renderbuffer((_TILE, _TILE), 4) for _ in range(2)]
    depth = ctx.depth_renderbuffer((_TILE, _TILE))
    tile = ctx.framebuffer(targets, depth)

    scale = 2 / (_TILE * texel_mm)
    program["texel_mm"] = texel_mm
    program["gutter_clip"] = [tuple(shift) for shift in _gutter_texels(texel_mm) * 2 / _TILE]
    images = [np.zeros((height, width, 4), np.uint8) for _ in targets]
    program.bind(textures)
    tile.use()
    ctx.enable_only(moderngl.DEPTH_TEST)
    ctx.scissor = None
    for y in range(0, height, _TILE):
        for x in range(0, width, _TILE):
            tile.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            program["atlas_to_clip"] = (scale, scale, -1 - 2 * x / _TILE, -1 - 2 * y / _TILE)
            array.render(moderngl.TRIANGLES, instances=GUTTER_STEPS)
            _read_tile(tile, images, x, y)
    items: list[Any] = [tile, *targets, depth, array, vertex_buffer, index_buffer]
    for item in items:
        item.release()

    # texels outside all parts show only in coarse mip levels
    empty = images[0][..., 3] == 0
    for image in images:
        median = [_median(channel[~empty]) for channel in np.moveaxis(image, -1, 0)]
        np.copyto(image, np.array(median, np.uint8), where=empty[..., None])
    return _atlas(images, texel_mm)


def _median(values: NDArray[np.uint8]) -> int:
    """Return the median of bytes, rounded down; counting them is faster than sorting them."""
    ends = np.cumsum(np.bincount(values, minlength=256))
    middle = (len(values) - 1) // 2, len(values) // 2
    low, high = np.searchsorted(ends, middle, side="right")
    return int(low + high) // 2


def bake_ground(
    ctx: moderngl.Context,
    program: ShaderProgram,
    textures: Textures,
    reach_mm: float,
    texel_mm: float,
) -> Atlas:
    """Bake the ground around the world's origin. Its uniform blocks are filled already.

    Args:
        ctx: Current context.
        program: Program of ground_bake.frag.
        textures: Textures that the program reads.
        reach_mm: Half of the side of the baked square.
        texel_mm: Width of a texel; a wider one is taken if the square has more than GROUND_TEXELS.
    """
    texel_mm = max(texel_mm, 2 * reach_mm / GROUND_TEXELS)
    side = int(np.ceil(2 * reach_mm / texel_mm))
    targets = [ctx.renderbuffer((_TILE, _TILE), 4) for _ in range(2)]
    tile = ctx.framebuffer(targets)
    images = [np.zeros((side, side, 4), np.uint8) for _ in targets]
    program.bind(textures)
    program["texel_mm"] = texel_mm
    tile.use()
    ctx.enable_only(moderngl.NOTHING)
    ctx.scissor = None
    for y in range(0, side, _TILE):
        for x in range(0, side, _TILE):
            program["low_mm"] = (x * texel_mm - reach_mm, y * texel_mm - reach_mm)
            program.draw_vertices(3)
            _read_tile(tile, images, x, y)
    tile.release()
    for target in targets:
        target.release()
    return _atlas(images, texel_mm)


def _read_tile(tile: moderngl.Framebuffer, images: list[NDArray[np.uint8]], x: int, y: int) -> None:
    """Copy the attachments of a tile to its place in images of the whole."""
    for i, image in enumerate(images):
        data = tile.read(components=4, attachment=i, alignment=1)
        texels = np.frombuffer(data, np.uint8).reshape(_TILE, _TILE, 4)
        part = image[y : y + _TILE, x : x + _TILE]
        part[:] = texels[: part.shape[0], : part.shape[1]]


def _atlas(images: list[NDArray[np.uint8]], texel_mm: float) -> Atlas:
    """Return the atlas of an albedo and a surface image with row 0 at the bottom."""
    base_color, surface = (np.ascontiguousarray(image[::-1, :, :3]) for image in images)
    return Atlas(base_color, surface, texel_mm)


def bake_program(
    programs: Programs, damage: str = "undamaged", kinds: tuple[str, ...] = DRAWN_DAMAGE_CLASSES
) -> ShaderProgram:
    """Return the program that bakes a mesh of one of DAMAGE_VARIANTS; holes are not cut out.

    Args:
        programs: The programs of the renderer.
        damage: One of DAMAGE_VARIANTS.
        kinds: Kinds of damage that it can draw.
    """
    if damage == "undamaged":
        variant = ShaderVariant(damage="undamaged", pixel_class="decal")
    else:
        variant = ShaderVariant(damage="damaged", kinds=kinds, pixel_class="damaged")
    return programs.get(("bake.vert", "bake.frag"), variant)


def _gutter_texels(texel_mm: float) -> NDArray[np.float64]:
    """Return shifts [GUTTER_STEPS, 2] in texels, within half the gap of parts, nearest first."""
    reach = GUTTER_MM / 2 / texel_mm
    around = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
    near, far = min(1.0, reach), min(2.0, reach)
    return np.array([(0.0, 0.0), *(np.array(around) * near), *(np.array(around) * far)])
