"""Contents of data textures."""

import numpy as np
import pytest

from fastgen.render.gl import open_context
from fastgen.render.textures import data_texture


@pytest.mark.parametrize("dtype", [np.float32, np.uint32])
@pytest.mark.parametrize("shape", [(1, 1, 4), (2, 143, 4), (32, 5, 4), (33, 64, 2)])
def test_data_textures_are_padded_with_zeros_to_powers_of_two(shape, dtype):
    values = np.random.default_rng(5).integers(1, 1 << 20, shape).astype(dtype)
    with open_context() as gl:
        texture = data_texture(gl.ctx, values)
        width, height = texture.size
        found = np.frombuffer(texture.read(), dtype).reshape(height, width, shape[2])
    assert all(np.log2(side).is_integer() for side in (width, height))
    assert height < 2 * shape[0]
    assert width < 2 * shape[1]
    np.testing.assert_array_equal(found[: shape[0], : shape[1]], values)
    assert not found[shape[0] :].any()
    assert not found[:, shape[1] :].any()
