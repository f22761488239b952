"""Output of the benchmarks: result files, tables in the docs, and the machine they ran on."""

import json
import os
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import fastgen

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"


def origin() -> dict[str, str]:
    """Return the machine and the fastgen version that figures belong to."""
    return {"machine": machine(), "fastgen": fastgen.__version__}


def machine() -> str:
    """Return the processor model and the number of cores that this process may use."""
    model = "unknown processor"
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    return f"{model}, {len(os.sched_getaffinity(0))} cores"


def heading() -> str:
    """Return the machine and the version, for the line above a table of figures without a GPU."""
    return f"{machine()}, no GPU, version {fastgen.__version__}"


def parse_size(text: str) -> tuple[int, int]:
    """Parse a size such as 640x480 into (width, height).

    Raises:
        SystemExit: The text is not WIDTHxHEIGHT.
    """
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        raise SystemExit(f"{text!r} is not a size; write WIDTHxHEIGHT") from None
    return width, height


def save(name: str, figures: dict[str, Any]) -> None:
    """Write bench/results/NAME.json, from which `--redraw` draws the chart again."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def stored(name: str) -> dict[str, Any]:
    """Return the figures that `save` wrote.

    Raises:
        SystemExit: There are none.
    """
    path = RESULTS / f"{name}.json"
    if not path.exists():
        raise SystemExit(f"{path}: no such results; run python bench/{name}.py first")
    figures: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return figures


def write_section(
    name: str, lines: list[str], document: Path = ROOT / "docs" / "accuracy.md"
) -> None:
    """Print Markdown lines and write them between `begin NAME` and `end NAME` of a document.

    Raises:
        SystemExit: The document has no such markers.
    """
    print("\n".join(lines))
    text = document.read_text(encoding="utf-8")
    begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"{document}: add the markers {begin.strip()} ... {end} for {name}")
    whole = before + begin + "\n" + "\n".join(lines) + "\n\n" + end + after
    document.write_text(whole, encoding="utf-8")
