"""New names and numbers of images in a merged dataset, in paths, label files and archives."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO

import orjson

from fastgen.dataset.job import ARCHIVE_ENDINGS
from fastgen.formats.archives import renamed_tar
from fastgen.formats.format import Format, Record
from fastgen.formats.parquet import renamed_table

_LABEL_SUFFIXES = (".json", ".xml", ".txt")
"""Suffixes of files that may contain the name of their image."""


@dataclass(frozen=True)
class Renaming:
    """New names and numbers of the images and files of one shard.

    Attributes:
        prefix: Put before the stem of each image; may be empty.
        stems: Old stems of the images.
        shard: Old and new number of the shard.
        by: Added to the number of each image.
        formats: Formats of the dataset.
    """

    prefix: str
    stems: tuple[str, ...]
    shard: tuple[int, int]
    by: int
    formats: Sequence[Format]

    def path(self, path: str) -> str:
        """Return the new path of a file."""
        old, new = self.shard
        endings = "|".join(ARCHIVE_ENDINGS.values())
        archive = re.fullmatch(rf"(\w+-){old:06d}(\.(?:{endings}))", path)
        if archive:
            return f"{archive[1]}{new:06d}{archive[2]}"
        for each in self.formats if self.by else ():
            path = each.renumbered(path, self.by)
        return self.text(path)

    def text(self, text: str) -> str:
        """Return a text with the new names."""
        return self.content(text.encode()).decode()

    def content(self, content: bytes) -> bytes:
        """Return the content of a label file with the new names."""
        if not self.prefix:
            return content
        return self._names.sub(self.prefix.encode() + rb"\g<0>", content)

    def record(self, record: Record) -> Record:
        """Return the new record of an image."""
        renamed: Record = orjson.loads(self.content(orjson.dumps(record)))
        return {**renamed, "number": record["number"] + self.by}

    def changes_label(self, path: str) -> bool:
        """Return whether `content` may change the content of a file."""
        return bool(self.prefix) and path.endswith(_LABEL_SUFFIXES)

    def changes_archive(self, path: str) -> bool:
        """Return whether a file is an archive whose content `archive` changes."""
        numbered = path.endswith(".parquet") and self.by > 0
        return numbered or (path.endswith((".parquet", ".tar")) and bool(self.prefix))

    def archive(self, path: str, stream: BinaryIO) -> Iterator[bytes]:
        """Yield the new content of an archive in pieces.

        Raises:
            ValueError, tarfile.TarError: The file is not as its path says.
        """
        if path.endswith(".parquet"):
            return renamed_table(stream, self.text, self.by)
        return renamed_tar(stream, self._member)

    def _member(self, name: str, content: bytes) -> tuple[str, bytes]:
        return self.text(name), self.content(content) if self.changes_label(name) else content

    @cached_property
    def _names(self) -> re.Pattern[bytes]:
        """Pattern that finds stems, also at the start of longer names as in STEM_3.png."""
        stems = b"|".join(re.escape(stem.encode()) for stem in self.stems)
        return re.compile(rb"(?<![A-Za-z0-9_.-])(?:" + stems + rb")(?![A-Za-z0-9-])")
