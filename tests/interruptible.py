"""Child processes that hear Ctrl-C wherever the tests run."""

import signal
import subprocess
import sys
import time


def interruptible(command, **options):
    """Start a command like `subprocess.Popen`, with text in its pipes, and let it hear SIGINT.

    Background jobs of a shell, such as a test run, may ignore SIGINT, and so do their children.
    """
    return subprocess.Popen(
        command,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **options,
    )


def begun(out, *arguments, shards=0):
    """Start `fastgen generate` in its own session, and return it once it has begun to write.

    It has then written dataset.json and the manifests of so many shards.
    """
    process = interruptible(
        [sys.executable, "-m", "fastgen", "generate", str(out), *arguments],
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    deadline = time.monotonic() + 300
    while not (out / "dataset.json").exists() or len(list(out.glob("shards/*.json"))) < shards:
        assert process.poll() is None  # a finished run cannot be stopped
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process
