"""Archives of many samples: tar files for the `webdataset` package, and the members they hold."""

import io
import tarfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import PurePosixPath
from typing import BinaryIO

from fastgen.formats.format import Files, Record, Same
from fastgen.sampling.scene import SPLITS

Made = tuple[Files, Record]
"""Files and record of one sample, as `format.assemble` returns them."""


def by_split(made: Sequence[Made]) -> Iterator[tuple[str, list[Made]]]:
    """Yield each split that occurs, with its samples."""
    for split in SPLITS:
        chosen = [(files, record) for files, record in made if record["split"] == split]
        if chosen:
            yield split, chosen


def members(sample: Made) -> Iterable[tuple[str, bytes]]:
    """Yield extension and content of the members of one sample.

    Extensions are `jpg`, `json`, and for label files the name of the folder and the file's
    extension, as in `damage.png` and `imdg.txt`.
    """
    files, record = sample
    names: set[str] = set()
    for path, content in files.items():
        if isinstance(content, Same):
            continue
        name = _extension(path, record["stem"])
        assert name not in names, name
        names.add(name)
        yield name, content


def tar_files(made: Sequence[Made], shard: int) -> Files:
    """Pack samples as WebDataset shards: one tar file for each split that occurs.

    Members of a sample share its stem.
    """
    packed: Files = {}
    for split, chosen in by_split(made):
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as tar:
            for sample in chosen:
                for extension, content in members(sample):
                    member = tarfile.TarInfo(f"{sample[1]['stem']}.{extension}")
                    member.size = len(content)
                    tar.addfile(member, io.BytesIO(content))
        packed[f"{split}-{shard:06d}.tar"] = buffer.getvalue()
    return packed


def renamed_tar(
    stream: BinaryIO, rename: Callable[[str, bytes], tuple[str, bytes]]
) -> Iterator[bytes]:
    """Yield a tar file with other names in pieces, so that memory does not depend on its size.

    Args:
        stream: A file that `tar_files` made.
        rename: Returns new name and new content of a member.

    Raises:
        tarfile.TarError: The file is not a tar file.
    """
    buffer = io.BytesIO()
    with (
        tarfile.open(fileobj=stream) as old,
        tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as new,
    ):
        for member in old:
            content = old.extractfile(member)
            member.name, data = rename(member.name, content.read() if content else b"")
            member.size = len(data)
            new.addfile(member, io.BytesIO(data))
            yield drained(buffer)
    yield drained(buffer)


def drained(buffer: io.BytesIO) -> bytes:
    """Return the content of a buffer and empty it."""
    content = buffer.getvalue()
    buffer.seek(0)
    buffer.truncate()
    return content


def _extension(path: str, stem: str) -> str:
    pure = PurePosixPath(path)
    folder, *between = pure.parts[:-1]
    ending = pure.suffix[1:]
    if folder in ("images", "scenes"):
        return ending
    # kitti has files with the same name in different folders
    inner = [part for part in between if folder == "kitti" and part not in SPLITS]
    return ".".join((folder, *inner, ending))
