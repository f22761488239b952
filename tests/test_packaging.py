"""Contents of sdist and wheel: shaders and assets are included, tests and caches are not."""

import email
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PARTS = (
    *("fastgen", "shaders", "assets", "tests", "setup.cfg", "pyproject.toml", "MANIFEST.in"),
    *("README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"),
)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with an sdist of a clean copy of the sources, and a wheel made from that sdist."""
    place = tmp_path_factory.mktemp("built")
    source = place / "source"
    source.mkdir()
    subprocess.run(["cp", "-r", *(str(ROOT / part) for part in PARTS), str(source)], check=True)
    subprocess.run([sys.executable, "-m", "build", "--outdir", place, source], check=True)
    return place


@pytest.fixture(scope="module")
def wheel(built):
    (path,) = built.glob("*.whl")
    with zipfile.ZipFile(path) as file:
        yield file


@pytest.fixture(scope="module")
def names(wheel):
    """Names of the files in the wheel."""
    return wheel.namelist()


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


def test_every_file_of_the_studios_page_is_in_the_wheel(names):
    wanted = {f"fastgen/studio/page/{p.name}" for p in (ROOT / "fastgen/studio/page").iterdir()}
    assert wanted
    assert wanted <= set(names)


def test_the_page_of_the_report_is_in_the_wheel(names):
    assert {f"fastgen/report/{name}" for name in ("page.css", "charts.js", "page.js")} <= set(names)


def test_the_wheel_contains_no_tests_or_caches(names):
    assert not [n for n in names if n.startswith("tests") or "__pycache__" in n]


def test_every_module_is_in_the_wheel(names):
    modules = {str(p.relative_to(ROOT)) for p in (ROOT / "fastgen").rglob("*.py")}
    assert modules <= set(names)


def test_the_sdist_contains_the_changelog_and_no_part_of_the_tests(built):
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as file:
        inside = {name.partition("/")[2] for name in file.getnames()}
    assert {"CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md"} <= inside
    assert not [name for name in inside if name.startswith("tests")]


def test_the_metadata_names_authors_and_versions_of_python(wheel, names):
    (path,) = (name for name in names if name.endswith(".dist-info/METADATA"))
    metadata = email.message_from_bytes(wheel.read(path))
    assert metadata["Author"] == "fastgen developers"
    assert "Programming Language :: Python :: 3.11" in metadata.get_all("Classifier")
    assert metadata["Requires-Python"] == ">=3.11"
