"""Places of datasets as users write them: folders, and addresses such as s3://bucket/folder."""

import os
import re
from pathlib import Path

from fastgen.errors import OutputError

BUCKETS = frozenset({"s3", "gs", "abfs", "oss", "oci"})
"""fsspec's protocols of object stores."""

_LOCAL = ("file", "local")
_PROTOCOLS = BUCKETS.union(
    *(_LOCAL, ("s3a", "gcs", "abfss", "az", "adl", "r2", "http", "https", "ftp", "sftp", "ssh")),
    ("smb", "hdfs", "webhdfs", "dbfs", "memory"),
)
"""Protocols that are recognized in a mistyped address."""

_MISTYPED = re.compile(
    r"(?P<protocol>[A-Za-z][A-Za-z0-9+.-]+)(?P<mark>://|:/|:|//)/*(?P<rest>.*)", re.DOTALL
)
_WINDOWS = re.compile(r"[A-Za-z]:[\\/]|\\\\")


def place_of(out: str | Path) -> str:
    """Return the path of a folder, or an address with '://'.

    `~` and `~user` are replaced as in a shell. `file:///folder` gives the folder.

    Raises:
        OutputError: `out` is neither; the message says what was probably meant.
    """
    text = str(out)
    if not text:
        raise OutputError("'': is empty; give a folder or an address")
    if "\0" in text:
        raise OutputError(f"{text!r}: contains the character NUL, which no name can have")
    if text.startswith((":/", "://")):
        raise OutputError(
            f"{text}: has no protocol before the colon; give a folder, or an address such as "
            "s3://bucket/folder"
        )
    if _WINDOWS.match(text):
        raise OutputError(
            f"{text}: is a path of Windows; give one of this system, such as /mnt/c/folder, or "
            f"./{text} for a folder with that name"
        )
    parts = _MISTYPED.fullmatch(text)
    if parts:
        text = _checked_address(text, parts)
    return text if "://" in text else _without_tilde(text)


def _checked_address(text: str, parts: re.Match[str]) -> str:
    """Return an address, the folder of a local one, or a path that only resembles an address."""
    protocol, mark, rest = parts["protocol"].lower(), parts["mark"], parts["rest"]
    path = text[parts.end("mark") :]
    if mark != "://":
        if protocol in _PROTOCOLS or mark == ":/":
            raise _meant(text, f"{protocol}:///{rest}" if protocol in _LOCAL else None, parts)
        return text
    if protocol in _LOCAL:
        if not path.startswith(("/", "~")):
            raise _meant(text, f"{protocol}:///{rest}", parts)
        return path
    if protocol in BUCKETS and not rest:
        raise OutputError(f"{text}: names no bucket; give an address such as s3://bucket/folder")
    if (protocol in BUCKETS and path.startswith("/")) or parts["protocol"] != protocol:
        raise _meant(text, None, parts)
    return text


def _meant(text: str, address: str | None, parts: re.Match[str]) -> OutputError:
    address = address or f"{parts['protocol'].lower()}://{parts['rest'] or 'bucket/folder'}"
    return OutputError(
        f"{text}: is not an address; write {address} if you mean that, or ./{text} for a folder "
        "with that name"
    )


def _without_tilde(text: str) -> str:
    path = os.path.expanduser(text)
    if path.startswith("~"):
        user = text.split("/")[0]
        raise OutputError(
            f"{text}: there is no home folder {user}; write ./{text} for a folder with that name"
        )
    return path
