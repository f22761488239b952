"""Measure the time from a moved slider of `fastgen studio` to the new picture in a browser.

    python bench/studio_latency.py [--moves 40] [--size 640x640] [--preset seafront]

Each move waits until the draft of the last one is on the screen. The table has medians over the
moves of one slider. "picture" is the wall time from the event of the slider to the frame with the
picture. "render" is the part that the server reports for sampling and rendering, and "rest" is
left for requests, copies and painting. CPU time is a mean per move; Chromium's includes Playwright.

It needs Playwright (`pip install playwright`) and Chromium (`make chromium`). The table is only
printed, because the figures depend on the load of the machine.
"""

import argparse
import os
import re
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples"))

from playwright.sync_api import Page, expect
from reporting import machine
from screenshots import WINDOW, chromium, refined, studio
from startup import cpu_seconds, family

SLIDERS = {
    "surface.rust_coverage": "surface rust coverage, highest, slider",
    "damage.probability": "damage probability, slider",
    "environment.yaw_deg": "environment yaw, highest, slider",
    "weather.fog_probability": "weather fog probability, slider",
}

_MOVE = """async ([label, share]) => {
  const slider = document.querySelector(`input[aria-label='${label}']`);
  const status = document.getElementById("status");
  const drawn = new Promise((resolve) => new MutationObserver((_, observer) => {
    observer.disconnect();
    resolve();
  }).observe(status, { childList: true }));
  const start = performance.now();
  slider.value = Number(slider.min) + share * (slider.max - slider.min);
  slider.dispatchEvent(new Event("input"));
  await drawn;
  await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
  return [performance.now() - start, status.textContent];
}"""


class Move(NamedTuple):
    """Wall times in ms of one move: until the picture is on the screen, and of rendering."""

    shown_ms: float
    rendering_ms: float


def moved(page: Page, label: str, share: float) -> Move:
    """Move a slider to a share of its length, and wait for the draft."""
    shown_ms, words = page.evaluate(_MOVE, [label, share])
    found = re.fullmatch(r"draft: \d+ ms, of which rendering (\d+) ms", words)
    if found is None:
        raise SystemExit(f"the studio answered {words!r} instead of a draft")
    return Move(shown_ms, float(found[1]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=40)
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--preset", default="seafront")
    options = parser.parse_args()
    words = "--size", options.size, "--preset", options.preset
    print(f"{machine()}, preset {options.preset}, {options.size}")
    columns = "picture ms", "render ms", "rest ms", "server CPU ms", "Chromium CPU ms"
    print(f"{'slider':25}" + "".join(f"{name:>17}" for name in columns))
    with studio(*words) as (address, server), chromium() as browser:
        page = browser.new_page(viewport=WINDOW)
        page.goto(address)
        refined(page)
        # no refined picture begins between two moves
        page.get_by_label("Quality", exact=True).select_option("draft")
        expect(page.locator("figcaption")).to_contain_text("draft")
        for key, label in SLIDERS.items():
            shares = [0.2 + 0.6 * k / options.moves for k in range(options.moves)]
            moved(page, label, 0.1)
            before = _cpu_s(server.pid)
            moves = [moved(page, label, share) for share in shares]
            spent = [b - a for a, b in zip(before, _cpu_s(server.pid), strict=True)]
            shown, rendering = (statistics.median(each) for each in zip(*moves, strict=True))
            cpu_ms = (1000 * each / options.moves for each in spent)
            figures = shown, rendering, shown - rendering, *cpu_ms
            print(f"{key:25}" + "".join(f"{value:17.0f}" for value in figures), flush=True)


def _cpu_s(server: int) -> tuple[float, float]:
    """Return the CPU time so far of the server, and of the browser with its driver."""
    others = set(family(os.getpid())) - {os.getpid(), *family(server)}
    return sum(map(cpu_seconds, family(server))), sum(map(cpu_seconds, others))


if __name__ == "__main__":
    main()
