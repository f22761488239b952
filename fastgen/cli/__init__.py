"""The `fastgen` command: parsing of arguments and printing of results."""
