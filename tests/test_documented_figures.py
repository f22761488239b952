"""Figures in the README and in docs/benchmarks.md are those of bench/results."""

import re
from pathlib import Path

import documented

ROOT = Path(documented.__file__).parent.parent


def section(name):
    text = documented.SECTIONS[name].read_text(encoding="utf-8")
    return text.partition(f"<!-- begin {name} -->")[2].partition(f"<!-- end {name} -->")[0].strip()


def test_pages_have_the_figures_of_the_latest_results():
    fix = "run python bench/documented.py"
    assert section("speed accuracy labels") == "\n".join(documented.readme_lines()), fix
    assert section("labels") == "\n".join(documented.label_lines()), fix
    assert section("times") == "\n".join(documented.time_lines()), fix


def test_cpu_time_in_the_introduction_is_that_of_draft_and_balanced():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    low, high = map(int, re.search(r"takes (\d+) to (\d+) ms of CPU time", readme).groups())
    assert 0.9 * low <= documented.cpu_ms("draft") <= 1.2 * low
    assert 0.8 * high <= documented.cpu_ms("balanced") <= 1.1 * high


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150
