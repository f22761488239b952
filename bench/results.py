"""Where the figures of a bench go, and what machine they come from."""

import json
import os
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"


def machine() -> str:
    """Processor and the cores that this process may use."""
    model = "unknown processor"
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    return f"{model}, {len(os.sched_getaffinity(0))} cores"


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of text such as 640x480; ends the program with a message for other text."""
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        raise SystemExit(f"{text!r} is no size; write WIDTHxHEIGHT") from None
    return width, height


def save(name: str, figures: dict[str, Any]) -> None:
    """Write bench/results/NAME.json, from which the charts in docs/ can be drawn again."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
