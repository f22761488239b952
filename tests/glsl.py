"""Single shader functions run on the GPU, for tests."""

import numpy as np

from fastgen.classes import DRAWN_DAMAGE_CLASSES
from fastgen.render.blocks import BLOCKS
from fastgen.render.constants import CONSTANTS
from fastgen.render.program import expand, shader_text
from fastgen.render.variant import ShaderVariant

NEEDS = [f"{name}.constants" for name in CONSTANTS] + [f"{name}.block" for name in BLOCKS]
HEAD = "#version 430 core\n" + "".join(
    f'#include "{name}"\n' for name in (*NEEDS, "surface_id.glsl")
)


def run(gl, body, inputs, textures=None, damage="undamaged", kinds=DRAWN_DAMAGE_CLASSES, **others):
    """Return `vec4 f(vec4 x)`, defined in GLSL `body`, at each row of inputs [N, 4] as [N, 4].

    `others` are further arguments of ShaderVariant.
    """
    ctx = gl.ctx
    main = (
        "\nuniform sampler2D inputs; layout(location = 0) out vec4 answer;\n"
        "void main() { answer = f(texelFetch(inputs, ivec2(gl_FragCoord.xy), 0)); }\n"
    )
    variant = ShaderVariant(damage=damage, kinds=kinds, **others)
    program = ctx.program(
        vertex_shader=expand(shader_text("fullscreen.vert"), ShaderVariant()),
        fragment_shader=expand(HEAD + body + main, variant),
    )
    rows = np.ascontiguousarray(inputs, np.float32)
    held = {
        "inputs": ctx.texture((len(rows), 1), 4, rows.tobytes(), dtype="f4"),
        **(textures or {}),
    }
    for unit, (name, texture) in enumerate(held.items()):
        if name in program:
            program[name] = unit
        texture.use(unit)
    target = ctx.texture((len(rows), 1), 4, dtype="f4")
    frame = ctx.framebuffer([target])
    frame.use()
    ctx.disable(ctx.DEPTH_TEST)
    ctx.vertex_array(program, []).render(ctx.TRIANGLES, vertices=3)
    return np.frombuffer(target.read(), np.float32).reshape(-1, 4)


def blocks(gl, **changed):
    """Bind uniform blocks that are zero except for the members in `changed`.

    They stay valid as long as the caller keeps the returned buffers.
    """
    kept = []
    for block in BLOCKS.values():
        values = {}
        for member in block.members:
            size = {"vec2": 2, "vec3": 3, "vec4": 4, "mat4": 16}.get(member[0], 1)
            values[member[1]] = changed.get(member[1], np.zeros(size))
        buffer = gl.ctx.buffer(block.pack(values))
        buffer.bind_to_uniform_block(block.binding)
        kept.append(buffer)
    return kept
