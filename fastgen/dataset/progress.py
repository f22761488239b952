"""Progress line with rate and time left: live on a terminal, now and then in a log."""

import os
import sys
import time
from typing import TextIO

_BAR = 28
_LOG_S = 15.0
"""Seconds between two lines in a log."""


class Progress:
    """Counts images or other things toward a total and shows the count.

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
        self._began = self._shown = time.monotonic()
        self._live = self._stream.isatty()

    @property
    def made(self) -> int:
        """Images counted so far, without those that existed."""
        return self._done - self._first

    def add(self, images: int) -> None:
        """Count `images` more, up to the total, and redraw when it is time.

        Images of a worker that died are made again and count twice.
        """
        self._done = min(self._done + images, self._total)
        now = time.monotonic()
        if now - self._shown >= (0.1 if self._live else _LOG_S):
            self._shown = now
            self._draw()

    def close(self) -> None:
        """Draw the last state."""
        self._draw()
        if self._live:
            self._show("\n")

    def close_if_drawn(self) -> None:
        """Draw the last state if an earlier one was drawn, so that short work prints nothing."""
        if self._drawn:
            self.close()

    def _draw(self) -> None:
        self._drawn = True
        rate = self.made / max(time.monotonic() - self._began, 1e-9)
        left_s = int((self._total - self._done) / rate) if rate > 0 else 0
        filled = _BAR * self._done // max(self._total, 1)
        bar = "#" * filled + "." * (_BAR - filled)
        line = (
            f"[{bar}] {self._done}/{self._total} {self._unit}, {rate:.1f}/s, "
            f"{left_s // 60}:{left_s % 60:02d} left"
        )
        self._show(f"\r{line}\x1b[K" if self._live else f"{line}\n")

    def _show(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except BrokenPipeError:
            raise
        except OSError:  # for example a log on a full disk, which must not end the run
            self._stream = open(os.devnull, "w")  # noqa: SIM115
