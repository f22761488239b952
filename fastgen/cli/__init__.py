"""The `fastgen` command: argument parsing and printing."""
