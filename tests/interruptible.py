"""Child processes that hear Ctrl-C wherever the tests run."""

import signal
import subprocess


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
