"""Screenshots of `fastgen studio` and `fastgen report`: docs/studio.jpg and docs/report.jpg.

    python examples/screenshots.py [studio report]

It needs Playwright (`pip install playwright`) and Chromium (`make chromium`).
"""

import argparse
import contextlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

FOLDER = Path(__file__).resolve().parent.parent / "docs"
PROGRAMS = ("chromium", "google-chrome")
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
"""Chromium as root in a container, without requests of its own."""

WINDOW: ViewportSize = {"width": 1280, "height": 1120}
QUALITY = 80
"""Quality of the JPEG files."""

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


@contextlib.contextmanager
def studio(*words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run `fastgen studio` with seed 7; yield its address and its process.

    Args:
        words: Further arguments of the command.
    """
    command = [sys.executable, "-m", "fastgen", "studio", "--no-browser", "--seed", "7", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.search(r"http://\S+/", process.stdout.readline())
        assert found is not None, "fastgen studio has printed why it did not start"
        try:
            yield found[0], process
        finally:
            process.send_signal(signal.SIGINT)


def refined(page: Page) -> None:
    """Wait until the studio shows a picture of the chosen quality."""
    expect(page.locator("figcaption")).to_contain_text("balanced", timeout=SLOW_MS)


def show_studio(page: Page) -> None:
    """Show a rusty container with boxes and the record of an object."""
    with studio() as (address, _):
        page.goto(address)
        refined(page)
        for end in ("highest", "lowest"):
            page.get_by_label(f"surface rust coverage, {end}", exact=True).first.fill("0.5")
        page.get_by_label("surface dirt strength, lowest", exact=True).first.fill("0.4")
        page.locator("#layer-boxes").check()
        expect(page.locator("#yaml")).to_have_value(re.compile("dirt"), timeout=SLOW_MS)
        refined(page)
        page.locator("#objects").select_option(index=1)
        _write(page, "studio")


def show_report(page: Page) -> None:
    """Show the report of a small dataset."""
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/boxes"
        for words in (["generate", out, "--images", "60", "--size", "512x512"], ["report", out]):
            subprocess.run([sys.executable, "-m", "fastgen", *words], check=True)
        page.goto(Path(f"{out}.report.html").as_uri())
        _write(page, "report")


PAGES = {"studio": show_studio, "report": show_report}


def _write(page: Page, name: str) -> None:
    page.screenshot(path=FOLDER / f"{name}.jpg", quality=QUALITY)


def main() -> None:
    """Write the screenshots."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(PAGES)}; default all")
    options = parser.parse_args()
    for name in options.names or PAGES:
        if name not in PAGES:
            parser.error(f"{name}: unknown page; use {', '.join(PAGES)}")
        with chromium() as browser:
            PAGES[name](browser.new_page(viewport=WINDOW, color_scheme="light"))


if __name__ == "__main__":
    main()
