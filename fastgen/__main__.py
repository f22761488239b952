"""The `fastgen` command, also as `python -m fastgen`."""

import sys

from fastgen.stopping import ended_at_once


def main() -> int:
    """Run the command line; returns its exit code, see `fastgen.cli.main`."""
    with ended_at_once():
        from fastgen import cli
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
