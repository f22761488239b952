"""Coverage-guided fuzzing of what fastgen reads. `make test` does not run it.

    pip install atheris
    python -m tests.stability.guided_fuzzing exr FOLDER -runs=20000 -rss_limit_mb=3072 -timeout=60

The first word is a key of READERS. FOLDER keeps the inputs that reached new code or failed, and a
later run continues from them. The options are those of libFuzzer. A run stops with a traceback at
the first input that is neither read nor refused in one clear line, that takes longer than the
timeout, or more memory than the limit.
"""

import json
import os
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")

import atheris

with atheris.instrument_imports(include=["fastgen"]):
    from fastgen import Config, Generator
    from fastgen.dataset.stats import report
    from fastgen.dataset.verify import examine
    from fastgen.errors import FastgenError
    from fastgen.light.hdri import load_radiance
    from fastgen.scene import Scene
    from fastgen.scene.check import check_scene
    from fastgen.torch import Loader

import cv2
import numpy as np
import yaml

from fastgen.cli.main import main as fastgen
from fastgen.config.yaml_values import Dumper
from tests.stability.test_fuzzed_input import assert_clear
from tests.stability.test_hostile_hdris import write
from tests.test_torch import dataset

ROOM = Path(tempfile.mkdtemp(prefix="guided_fuzzing_"))
MADE = ROOM / "made"
"""A finished dataset whose dataset.json is replaced."""

Reader = Callable[[bytes], object]


def in_file(path: Path, *readers: Callable[[Path], object]) -> Reader:
    """Return a reader of bytes that gives them to `readers` as a file."""

    def write_and_read(data: bytes) -> None:
        path.write_bytes(data)
        for read in readers:
            refused_clearly(partial(read, path))

    return write_and_read


def refused_clearly(read: Callable[[], object]) -> None:
    """Call `read`; only errors of fastgen may escape from it, and each is one clear line."""
    try:
        read()
    except FastgenError as error:
        assert_clear(error)


def read_config(path: Path) -> None:
    """Load a configuration and sample a scene from it."""
    Generator(Config.load(path), size=(64, 64)).scene(0)


def read_scene(data: bytes) -> None:
    """Load a scene and check it."""
    check_scene(Scene.from_json(data.decode("utf-8", "replace")))


def read_state(data: bytes) -> None:
    """Load the state of a loader."""
    try:
        state = json.loads(data)
    except ValueError:
        return
    Loader(dataset()).load_state_dict(state)


READERS: dict[str, Reader] = {
    "config": in_file(ROOM / "port.yaml", read_config),
    "hdr": in_file(ROOM / "sky.hdr", load_radiance),
    "exr": in_file(ROOM / "sky.exr", load_radiance),
    "scene": read_scene,
    "manifest": in_file(
        MADE / "dataset.json", lambda _: report(MADE), lambda _: examine(str(MADE))
    ),
    "state": read_state,
}


def seeds(name: str) -> list[bytes]:
    """Return valid inputs of a reader, from which the fuzzer starts."""
    if name == "config":
        plain = Config.preset().to_plain()
        return [yaml.dump({key: plain[key]}, Dumper=Dumper).encode() for key in plain]
    if name == "exr":
        return [write(ROOM / f"{kind}.exr", kind).read_bytes() for kind in ("lines", "parts")]
    if name == "hdr":
        picture = np.linspace(0, 2, 20 * 40 * 3, dtype=np.float32).reshape(20, 40, 3)
        cv2.imwrite(str(ROOM / "seed.hdr"), picture)
        return [(ROOM / "seed.hdr").read_bytes()]
    if name == "scene":
        return [Generator(Config.preset("gate"), seed=2, size=(64, 64)).scene(3).to_json().encode()]
    if name == "manifest":
        words = ["--images", "2", "--size", "64x64", "--cameras", "A", "--workers", "1"]
        assert fastgen(["generate", str(MADE), *words]) == 0
        return [(MADE / "dataset.json").read_bytes()]
    return [json.dumps(Loader(dataset()).state_dict()).encode()]


def main() -> None:
    """Fuzz the reader that the command line names."""
    name, folder, *options = sys.argv[1:]
    read = READERS[name]
    corpus = Path(folder)
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(name)):
        (corpus / f"seed_{number}").write_bytes(seed)
    found = f"-artifact_prefix={corpus}/"  # inputs that fail
    atheris.Setup(
        [sys.argv[0], str(corpus), found, *options],
        lambda data: refused_clearly(lambda: read(data)),
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
