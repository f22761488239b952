"""Which OpenGL backends work on this machine, and what to install if none does."""

import multiprocessing
from dataclasses import dataclass
from typing import Any

from fastgen.errors import FastgenError
from fastgen.gl import open_context

_TIMEOUT_S = 30.0
_MOST_DEVICES = 8


@dataclass(frozen=True)
class Finding:
    """One backend or device: whether it works, and its renderer string or why it failed."""

    name: str
    works: bool
    words: str


def diagnose() -> list[Finding]:
    """Try every EGL device and OSMesa, each in a process of its own: drivers may crash."""
    findings = []
    for index in range(_MOST_DEVICES):
        finding = _probe("egl", index)
        if not finding.works and index > 0:
            break
        findings.append(finding)
    findings.append(_probe("osmesa", None))
    return findings


def report() -> tuple[str, bool]:
    """What `fastgen doctor` prints, and whether anything works."""
    findings = diagnose()
    lines = [f"{'ok  ' if f.works else 'FAIL'}  {f.name:14}  {f.words}" for f in findings]
    works = any(finding.works for finding in findings)
    if not works:
        lines.append("Nothing renders here yet: follow one of the hints above.")
    return "\n".join(lines), works


def _probe(backend: str, index: int | None) -> Finding:
    name = backend if index is None else f"{backend} device {index}"
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_try, args=(backend, index, sender), daemon=True)
    process.start()
    sender.close()
    try:
        works, words = receiver.recv() if receiver.poll(_TIMEOUT_S) else (False, "no answer")
    except EOFError:
        process.join()
        works, words = False, f"the driver crashed (exit code {process.exitcode})"
    process.terminate()
    process.join()
    return Finding(name, works, words)


def _try(backend: str, index: int | None, sender: Any) -> None:
    try:
        with open_context(backend, index) as gl:
            sender.send((True, f"{gl.renderer}, OpenGL {gl.version}"))
    except FastgenError as error:
        sender.send((False, str(error)))
