"""Progress line with rate and time left: live on a terminal, now and then in a log."""

import math
import os
import shutil
import sys
import time
from typing import TextIO

from fastgen.dataset.console import is_live, shows_warnings

_BAR = 28
_LOG_S = 15.0
"""Seconds between two lines in a log."""

_LEAST_S = 1.0
"""Shortest time over which a rate is measured."""


class Progress:
    """Counts images or other things toward a total and shows the count.

    Nothing is shown if the logger "fastgen" shows errors only.

    Args:
        total: Number of images when all is done.
        done: Number of images that exist already.
        stream: Where to write; by default standard error.
        unit: What is counted.
    """

    def __init__(
        self, total: int, done: int = 0, stream: TextIO | None = None, unit: str = "images"
    ) -> None:
        self._total, self._done, self._first = total, done, done
        self._stream = stream or sys.stderr
        self._unit = unit
        self._drawn = False
        self._note = ""
        self._began = self._shown = time.monotonic()
        # the rate is measured from the first images on, because starting takes long
        self._started: tuple[float, int] | None = None
        self._live = is_live(self._stream)

    @property
    def made(self) -> int:
        """Images counted so far, without those that existed."""
        return self._done - self._first

    def add(self, count: int, note: str = "") -> None:
        """Count `count` more, up to the total, and redraw when it is time.

        Images of a worker that died are made again and count twice.

        Args:
            count: Number of things done since the last call.
            note: Words to show with the count.
        """
        self._done = min(self._done + count, self._total)
        self._note = note
        self._started = self._started or (time.monotonic(), self._done)
        self._draw_in_time()

    def note(self, words: str) -> None:
        """Show what is being done until the next images are counted."""
        self._note = words
        self._draw_in_time()

    def close(self) -> None:
        """Draw the last state."""
        self._draw()
        if self._live:
            self._show("\n")

    def close_if_drawn(self) -> None:
        """Draw the last state if an earlier one was drawn, so that short work prints nothing."""
        if self._drawn:
            self.close()

    def _draw_in_time(self) -> None:
        now = time.monotonic()
        first = self._live and self._note and not self._drawn
        if first or now - self._shown >= (0.1 if self._live else _LOG_S):
            self._shown = now
            self._draw()

    def _draw(self) -> None:
        self._drawn = True
        filled = _BAR * self._done // max(self._total, 1)
        bar = "#" * filled + "." * (_BAR - filled)
        parts = [f"[{bar}] {self._done}/{self._total} {self._unit}", *self._rate(), self._note]
        line = ", ".join(filter(None, parts))
        if self._live:  # a line that wraps could not be overwritten
            line = f"\r{line[: shutil.get_terminal_size().columns - 1]}\x1b[K"
        self._show(line if self._live else f"{line}\n")

    def _rate(self) -> list[str]:
        """Return rate and time left, or time taken; nothing if they are not known yet."""
        now = time.monotonic()
        if self._done == self._total:
            taken_s = now - self._began
            return [f"{self.made / max(taken_s, 1e-9):.1f}/s", f"took {_minutes(taken_s)}"]
        since, done = self._started or (now, self._done)
        if now - since < _LEAST_S or self._done == done:
            return []
        rate = (self._done - done) / (now - since)
        return [f"{rate:.1f}/s", f"{_minutes((self._total - self._done) / rate)} left"]

    def _show(self, text: str) -> None:
        if not shows_warnings():
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except BrokenPipeError:
            raise
        except OSError:  # for example a log on a full disk, which must not end the run
            self._stream = open(os.devnull, "w")  # noqa: SIM115


def _minutes(seconds: float) -> str:
    """Return minutes and seconds, rounded up: 0:00 would mean that nothing is left to wait for."""
    whole = math.ceil(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
