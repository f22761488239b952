"""Functions that cannot post-process samples: one line each, and nothing is written."""

import sys
from pathlib import Path

import pytest

from fastgen.cli.main import main

SIZE = ["--size", "192x192", "--quality", "draft"]

FAULTY = """
from dataclasses import replace
def raises(sample, rng):
    raise ValueError("no")
def nothing(sample, rng):
    return None
def smaller(sample, rng):
    return replace(sample, image=sample.image[1:])
def renamed(sample, rng):
    return replace(sample, objects=[replace(sample.objects[0], class_name="spreadr")])
def emptied(sample, rng):
    return replace(sample, objects=[replace(sample.objects[0], bbox=(5, 5, 2, 2))])
def cut(sample, rng):
    return replace(sample, objects=[replace(sample.objects[0], bbox=(1, 2))])
NUMBER = 1
"""


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A folder with a module of functions that cannot be used."""
    folder = tmp_path_factory.mktemp("faulty")
    (folder / "faulty.py").write_text(FAULTY)
    yield folder
    sys.modules.pop("faulty", None)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("faulty", "--set: postprocess: 'faulty' is not a function; write package.module:function"),
        ("faultily:raises", "postprocess: faultily:raises cannot be imported (ModuleNotFound"),
        ("faulty:missing", "postprocess: faulty:missing cannot be imported (AttributeError"),
        ("faulty:NUMBER", "postprocess: faulty:NUMBER is no function of a sample"),
        ("faulty:raises", "postprocess: faulty:raises raised ValueError('no'); mend it"),
        ("faulty:nothing", "postprocess: faulty:nothing returned None; it has to return a Sample"),
        (
            "faulty:smaller",
            "postprocess: faulty:smaller returned image as uint8 [191, 192, 3]; keep",
        ),
        (
            "faulty:renamed",
            "postprocess: faulty:renamed returned an object of the class 'spreadr' (did you mean "
            "spreader?)",
        ),
        ("faulty:cut", "postprocess: faulty:cut returned the box (1, 2) of"),
        ("faulty:emptied", "postprocess: faulty:emptied returned the box (5, 5, 2, 2) of"),
    ],
)
def test_an_unusable_function_gets_one_line(name, words, faulty, tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(faulty)
    picture = str(tmp_path / "x.png")
    given = ["show", "--index", "0", "-o", picture, *SIZE, "--set", f"postprocess={name}"]
    assert main(given) == 2
    assert capsys.readouterr().err.startswith(f"fastgen: {words}")
    assert not Path(picture).exists()
