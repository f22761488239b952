"""Names that `import fastgen` offers."""

import subprocess
import sys

import pytest

import fastgen
from fastgen import errors, scene


@pytest.mark.parametrize("name", fastgen.__all__)
def test_every_public_name_can_be_imported(name):
    assert getattr(fastgen, name).__name__ == name


def test_all_errors_and_parts_of_a_scene_are_public():
    names = {name for name in vars(errors) if name.endswith("Error")}
    names |= {name for name in scene.__all__ if isinstance(getattr(scene, name), type)}
    assert names <= set(fastgen.__all__)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'Genrator'"):
        fastgen.Genrator  # noqa: B018


def test_import_alone_loads_neither_numpy_nor_opencv():
    code = "import sys, fastgen; print(sorted({'numpy', 'cv2', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"
