"""The steps of the Dockerfile that install fastgen, run without Docker in a folder of their own."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LINES = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()


def steps(instruction):
    lines = [line.partition(" ")[2] for line in LINES if line.startswith(instruction + " ")]
    assert lines
    return lines


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """A folder for the root of the image, with what is copied and installed into it.

    Packages that fastgen needs are not installed again, because that takes minutes.
    """
    image = tmp_path_factory.mktemp("image")
    for *sources, target in map(str.split, steps("COPY")):
        for source in sources:
            path = image / target.strip("/")
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, path, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                path.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / source, path)
    (install,) = (line for line in steps("RUN") if line.startswith("make "))
    command = re.sub(r"(?<=[ =])/(?=src|opt)", f"{image}/", install)
    assert command.count(str(image)) == 2
    environment = {**os.environ, "PYTHON": sys.executable, "PIP_NO_DEPS": "1"}
    subprocess.run(command, shell=True, check=True, env=environment)
    return image


def test_the_installed_command_makes_a_dataset(image, tmp_path):
    values = variables()
    folder, _, inherited = values["PATH"].partition(":")
    assert inherited == "$PATH"
    programs = image / folder.strip("/")
    (packages,) = programs.parent.glob("lib/python3*/site-packages")
    (packages / "needed.pth").write_text(sysconfig.get_path("purelib"))
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}

    def run(program, *arguments):
        command = [programs / program, *arguments]
        return subprocess.run(
            command, check=True, env=environment, cwd=tmp_path, capture_output=True, text=True
        ).stdout

    used = run("python", "-c", "import fastgen; print(fastgen.__file__)")
    assert used.startswith(str(packages))
    (entry,) = steps("ENTRYPOINT")
    options = ["--images", "1", "--size", "64x64", "--quality", "draft", "--workers", "1"]
    run(*json.loads(entry), "generate", "out", *options)
    assert list(tmp_path.glob("out/**/*.jpg"))


def test_the_image_does_not_run_as_root_and_any_user_can_write_to_its_cache():
    (user,) = steps("USER")
    assert any(f"useradd {user}" in line for line in steps("RUN"))
    assert steps("VOLUME") == [variables()["XDG_CACHE_HOME"]]
    assert any(f"install -d -m 1777 {steps('VOLUME')[0]} " in line for line in steps("RUN"))


def variables():
    (text,) = steps("ENV")
    return dict(word.split("=", 1) for word in text.split())
