"""Packed radiance compared with the driver's packing and with the 9-bit error bound."""

import moderngl
import numpy as np
import pytest

from fastgen.light.rgb9e5 import LARGEST, packed, unpacked
from fastgen.render.gl import open_context
from tests.backends import BACKENDS

_RGB9_E5 = 0x8C3D


def colours() -> np.ndarray:
    """Colours [64, 64, 3] over all exponents, with black, single channels and rounding up."""
    rng = np.random.default_rng(4)
    values = 2.0 ** rng.uniform(-26, 15.99, (64, 64, 3))
    values[:8] *= rng.random((8, 64, 3)) < 0.5
    values[8, :, 0] = 2.0 ** np.arange(-24.0, 40.0).clip(-24, 15) * (1 - 2.0**-11)
    values[8, :, 1:] = 0
    values[9, 0] = LARGEST
    return values.astype(np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
def test_packing_equals_the_drivers(backend):
    values = colours()
    with open_context(backend) as gl:
        texture = gl.ctx.texture(
            (64, 64), 3, values.tobytes(), dtype="f4", internal_format=_RGB9_E5
        )
        target = gl.ctx.texture((64, 64), 4, dtype="f4")
        frame = gl.ctx.framebuffer([target])
        program = gl.ctx.program(
            vertex_shader="""#version 330
            void main() {
                vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
                gl_Position = vec4(4.0 * corner - 1.0, 0.0, 1.0);
            }""",
            fragment_shader="""#version 330
            uniform sampler2D texels;
            out vec4 color;
            void main() { color = texelFetch(texels, ivec2(gl_FragCoord.xy), 0); }""",
        )
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.use(0)
        frame.use()
        gl.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        theirs = np.frombuffer(target.read(), np.float32).reshape(64, 64, 4)[..., :3]
    np.testing.assert_array_equal(unpacked(packed(values)), theirs)


def test_the_error_is_at_most_half_a_step_of_the_largest_channel():
    values = colours()
    error = np.abs(unpacked(packed(values)) - values)
    largest = np.maximum(values.max(axis=-1, keepdims=True), 2.0**-15)
    assert (error <= largest / 2**9).all()


def test_out_of_range_values_are_clamped():
    assert unpacked(packed(np.array([1e6, 0.0, -1.0]))).tolist() == [LARGEST, 0.0, 0.0]
