"""Screenshot of `fastgen studio` with changed values and boxes: docs/studio.jpg.

python examples/studio_screenshot.py docs/studio.jpg

It needs Playwright (`pip install playwright`) and Chromium (`make chromium`).
"""

import argparse
import contextlib
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

PROGRAMS = ("chromium", "google-chrome")
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
"""Chromium as root in a container, without requests of its own."""

WINDOW: ViewportSize = {"width": 1280, "height": 960}
SLOW_MS = 120_000
"""Longest wait for a picture. A first one prepares light and shaders."""


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """Run the installed Chromium without a window.

    Raises:
        SystemExit: It is not installed.
    """
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise SystemExit("Chromium is not installed; run `make chromium`")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(FLAGS))
        yield browser
        browser.close()


def change(page: Page) -> None:
    """Make the container rusty, and show boxes and the record of its identifier."""
    for end in ("highest", "lowest"):
        page.get_by_label(f"surface rust coverage, {end}", exact=True).first.fill("0.5")
    page.get_by_label("surface dirt strength, lowest", exact=True).first.fill("0.4")
    page.locator("#layer-boxes").check()
    expect(page.locator("#yaml")).to_have_value(re.compile("dirt"), timeout=SLOW_MS)
    expect(page.locator("figcaption")).to_contain_text("balanced", timeout=SLOW_MS)
    page.locator("#objects").select_option(index=1)


def main() -> None:
    """Start the studio, take the picture, and stop it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="JPEG or PNG to write")
    file = parser.parse_args().file
    words = ["studio", "--no-browser", "--seed", "7"]
    command = [sys.executable, "-m", "fastgen", *words]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio,
        chromium() as browser,
    ):
        assert studio.stdout is not None
        found = re.search(r"http://\S+/", studio.stdout.readline())
        assert found is not None, "fastgen studio has printed why it did not start"
        page = browser.new_page(viewport=WINDOW, color_scheme="light")
        page.goto(found[0])
        expect(page.locator("figcaption")).to_contain_text("balanced", timeout=SLOW_MS)
        change(page)
        page.screenshot(path=file)
        studio.send_signal(signal.SIGINT)


if __name__ == "__main__":
    main()
