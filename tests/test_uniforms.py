"""Uniform blocks packed by std140, compared with the values that the driver reads."""

import moderngl
import numpy as np
import pytest

from fastgen.render.blocks import BLOCKS
from fastgen.render.gl import open_context
from fastgen.render.uniforms import Block

BLOCK = Block(
    "Probe",
    3,
    (
        ("float", "a"),
        ("vec3", "b"),
        ("float", "c"),
        ("vec2", "d"),
        ("vec4", "e", 2),
        ("mat4", "f"),
        ("int", "g"),
    ),
)

VALUES = {
    "a": 1.0,
    "b": (2, 3, 4),
    "c": 5.0,
    "d": (6, 7),
    "e": [(8, 9, 10, 11), (12, 13, 14, 15)],
    "f": np.arange(16, 32).reshape(4, 4),
    "g": 32,
}

READ = [
    *("a", "b.x", "b.y", "b.z", "c", "d.x", "d.y"),
    *(f"e[{k}].{c}" for k in (0, 1) for c in "xyzw"),
    *(f"f[{column}][{row}]" for row in range(4) for column in range(4)),
    "float(g)",
]


def test_the_driver_reads_back_what_was_packed():
    reads = "\n".join(f"values[{i}] = {name};" for i, name in enumerate(READ))
    shader = (
        "#version 430\nlayout(local_size_x = 1) in;\n"
        f"layout(std430, binding = 0) buffer Out {{ float values[{len(READ)}]; }};\n"
        f"{BLOCK.glsl()}\nvoid main() {{ {reads} }}"
    )
    with open_context() as gl:
        program = gl.ctx.compute_shader(shader)
        out = gl.ctx.buffer(reserve=4 * len(READ))
        out.bind_to_storage_buffer(0)
        block = gl.ctx.buffer(BLOCK.pack(VALUES))
        block.bind_to_uniform_block(BLOCK.binding)
        program.run()
        gl.ctx.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT)
        values = np.frombuffer(out.read(), np.float32)
    np.testing.assert_array_equal(values, np.arange(1, len(READ) + 1))


def test_a_missing_member_raises_an_assertion_error():
    with pytest.raises(AssertionError, match="missing"):
        BLOCK.pack({key: value for key, value in VALUES.items() if key != "c"})


@pytest.mark.parametrize("name", BLOCKS)
def test_every_driver_has_room_for_a_block(name):
    """MAX_UNIFORM_BLOCK_SIZE is at least 16384 (OpenGL 4.5 core specification, chapter 23)."""
    assert BLOCKS[name].size <= 16384
