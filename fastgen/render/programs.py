"""Shader programs by keyword arguments, until every pass holds a ShaderVariant."""

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.render import program as source
from fastgen.render.blocks import DAMAGE_BLOCK, SCENE_BLOCK, VIEW_BLOCK
from fastgen.render.constants import *  # noqa: F403
from fastgen.render.noise import noise_tiles
from fastgen.render.variant import *  # noqa: F403
from fastgen.render.variant import ShaderVariant
from fastgen.render.zone_codes import *  # noqa: F403
from fastgen.resources import shader_path
from fastgen.scene.limits import DECAL_KINDS, MAX_DAMAGES

OUT_OF_REACH_MM = 1e6


def noise_deviation() -> NDArray[np.float32]:
    return noise_tiles().lost_deviation.reshape(-1, 4)


def expand(text: str, suns: int = 0, **variant: Any) -> str:
    return source.expand(text, ShaderVariant(lights=suns, **variant))


def link(
    ctx: moderngl.Context, vertex: str, fragment: str, samplers: Mapping[str, int], **variant: Any
) -> moderngl.Program:
    """Compile and link two shader files; samplers: texture unit of each sampler uniform."""
    program = ctx.program(
        vertex_shader=expand(shader_path(vertex).read_text(encoding="utf-8"), **variant),
        fragment_shader=expand(shader_path(fragment).read_text(encoding="utf-8"), **variant),
    )
    _assign(program, samplers)
    return program


def link_compute(
    ctx: moderngl.Context, compute: str, samplers: Mapping[str, int], **variant: Any
) -> moderngl.ComputeShader:
    """Compile and link a compute shader file; samplers: as for `link`."""
    program = ctx.compute_shader(
        expand(shader_path(compute).read_text(encoding="utf-8"), **variant)
    )
    _assign(program, samplers)
    return program


def _assign(
    program: moderngl.Program | moderngl.ComputeShader, samplers: Mapping[str, int]
) -> None:
    for name, unit in samplers.items():
        if name in program:
            program[name] = unit
