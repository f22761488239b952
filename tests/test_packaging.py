"""Wheel contents: shaders and assets are included, tests and caches are not."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """Names of the files in a wheel built from a clean copy of the sources."""
    place = tmp_path_factory.mktemp("wheel")
    source = place / "source"
    subprocess.run(["cp", "-r", *(str(ROOT / p) for p in _parts()), str(_made(source))], check=True)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(place)]
    subprocess.run([*command, str(source)], check=True)
    (wheel,) = place.glob("*.whl")
    return zipfile.ZipFile(wheel).namelist()


def _parts():
    return ("fastgen", "shaders", "assets", "setup.cfg", "pyproject.toml", "README.md", "LICENSE")


def _made(folder):
    folder.mkdir()
    return folder


def test_every_shader_and_asset_is_in_the_wheel(names):
    for folder, pattern in (
        ("shaders", "*.*"),
        ("assets/hdri", "*.exr"),
        ("assets/hdri", "*.png"),
        ("assets/markers", "*.png"),
        ("assets/stickers", "*.png"),
        ("assets/stickers", "*.json"),
        ("assets/fonts", "*.*"),
    ):
        wanted = {f"fastgen/{folder}/{p.name}" for p in (ROOT / folder).glob(pattern)}
        assert wanted
        assert wanted <= set(names)


def test_the_page_of_the_report_is_in_the_wheel(names):
    assert {f"fastgen/report/{name}" for name in ("page.css", "charts.js", "page.js")} <= set(names)


def test_the_wheel_contains_no_tests_or_caches(names):
    assert not [n for n in names if n.startswith("tests") or "__pycache__" in n]


def test_every_module_is_in_the_wheel(names):
    modules = {str(p.relative_to(ROOT)) for p in (ROOT / "fastgen").rglob("*.py")}
    assert modules <= set(names)
