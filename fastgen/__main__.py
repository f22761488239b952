"""The `fastgen` command, also as `python -m fastgen`."""

import sys

from fastgen.cli.stopping import ended_at_once


def main() -> int:
    """Run the command line and return its exit code; see `fastgen.cli.main.main`."""
    with ended_at_once():
        local = not {"-h", "--help", "--ray"}.intersection(sys.argv)
        if sys.argv[1:2] == ["generate"] and local:
            from fastgen.dataset.workers import fork_from_here

            fork_from_here()
        from fastgen.cli.main import main as run
    return run()


if __name__ == "__main__":
    sys.exit(main())
