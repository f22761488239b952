"""Diagnosis of the OpenGL backends of a machine, behind `fastgen doctor`."""

import multiprocessing
import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fastgen.errors import FastgenError
from fastgen.render.contexts.driver_variables import advice
from fastgen.render.gl import egl_devices, open_context

_START_S = 60.0
"""Time limit for a new process to import its modules, before the driver is tried."""

_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class Finding:
    """Result for one backend or device.

    Attributes:
        name: Backend or device.
        works: Whether a context could be opened.
        words: Renderer string, or the reason of the failure.
    """

    name: str
    works: bool
    words: str


def diagnose() -> list[Finding]:
    """Try every EGL device and OSMesa, each in its own process, because drivers crash and hang."""
    listed, answer = _isolated(_egl_device_names)
    if not listed:
        findings = [Finding("egl", False, answer)]
    elif not answer:  # only Mesa's surfaceless platform may work
        findings = [Finding("egl", *_isolated(_renderer, "egl", None))]
    else:
        findings = [
            Finding(name, *_isolated(_renderer, "egl", index)) for index, name in enumerate(answer)
        ]
    return [*findings, Finding("osmesa", *_isolated(_renderer, "osmesa", None))]


def report() -> tuple[str, bool]:
    """Return the text that `fastgen doctor` prints, and whether any backend works."""
    findings = diagnose()
    width = max(len(finding.name) for finding in findings)
    lines = [f"{'ok  ' if f.works else 'FAIL'}  {f.name:{width}}  {f.words}" for f in findings]
    works = any(finding.works for finding in findings)
    if not works:
        lines.append("Nothing renders here yet: follow one of the hints above.")
    return "\n".join(lines), works


def _egl_device_names() -> list[str]:
    return [
        f"egl device {index} ({'software' if device.software else 'hardware'})"
        for index, device in enumerate(egl_devices())
    ]


def _renderer(backend: str, index: int | None) -> str:
    with open_context(backend, index) as gl:
        return f"{gl.renderer}, OpenGL {gl.version}"


def _isolated(attempt: Callable[..., Any], *arguments: Any) -> tuple[bool, Any]:
    """Run `attempt` in a new process; return True and its result, or False and an error text."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, attempt, arguments), daemon=True)
    process.start()
    sender.close()
    try:
        if receiver.poll(_START_S):
            receiver.recv()
        if receiver.poll(_TIMEOUT_S):
            answer: tuple[bool, Any] = receiver.recv()
            return answer
        return False, _with_advice(f"no answer within {_TIMEOUT_S:g} s: the driver hangs")
    except EOFError:
        process.join()
        code = process.exitcode or 0
        ended = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return False, _with_advice(f"the driver crashed ({ended})")
    finally:
        process.kill()
        process.join()
        receiver.close()


def _with_advice(words: str) -> str:
    return "; ".join(filter(None, (words, advice(""))))


def _answer(sender: Any, attempt: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    sender.send("started")
    try:
        answer = True, attempt(*arguments)
    except FastgenError as error:
        answer = False, str(error)
    sender.send(answer)
