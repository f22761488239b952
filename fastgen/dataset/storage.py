"""Where a dataset lies: a folder, or any address that fsspec knows. Files arrive whole or not.

Paths within it are relative, with forward slashes.
"""

import contextlib
import ctypes
import fcntl
import os
import shutil
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from fastgen.errors import FastgenError, OutputError
from fastgen.files.atomic_file import ASIDE_FILES, whole_file
from fastgen.formats import Files, Same

ASIDE = ".aside"
"""Prefix of folders where files wait until all of their shard are on the disk."""

LOCK = ".lock"

_RECOVERED = "lost+found"
"""Where a file system keeps what it finds; a volume of its own has it from the start."""

_BUCKETS = frozenset({"s3", "gs", "abfs", "oss", "oci"})
"""Protocols of fsspec's object stores."""


class Folder:
    """A dataset in a folder of this machine."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def commit(self, files: Files, name: str) -> None:
        """Write aside, flush, rename. name: distinguishes this commit from others under way."""
        aside = self.root / f"{ASIDE}-{name}-{uuid.uuid4().hex}"
        # text: paths that pathlib parses take longer than what is done with them
        places = {path: f"{aside}/{number}" for number, path in enumerate(files)}
        try:
            aside.mkdir()
            for path, content in files.items():
                if isinstance(content, Same):
                    _link(places[content.path], places[path])
                else:
                    with open(places[path], "wb") as stream:
                        stream.write(content)
            _flush(aside)
            for folder in {os.path.dirname(path) for path in files}:
                (self.root / folder).mkdir(parents=True, exist_ok=True)
            for path, place in places.items():
                # POSIX leaves the old name where both are one file already; it goes with `aside`
                os.replace(place, f"{self.root}/{path}")
        except FileNotFoundError as error:
            raise OutputError(f"{self.root}: vanished while it was written ({error})") from None
        except OSError as error:
            raise OutputError(f"{self.root}: cannot be written ({error.strerror})") from None
        finally:
            shutil.rmtree(aside, ignore_errors=True)

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Written aside, flushed, renamed."""
        target = self.root / path
        with _told(target, "written"):
            target.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(target) as stream:
                stream.writelines(pieces)

    def make_folders(self, paths: Iterable[str]) -> None:
        """Have these folders even where nothing is in them."""
        for path in paths:
            with _told(self.root / path, "written"):
                (self.root / path).mkdir(parents=True, exist_ok=True)

    def read(self, path: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        place = self.root / path
        with _told(place, "read"):
            # a pipe would keep us waiting
            if not (place.is_file() or place.is_dir()) and place.exists():
                raise OutputError(f"{place}: is no file")
            return place.read_bytes()

    def remove(self, path: str) -> None:
        """Be without a file, or an empty folder in its place, whether it was there or not."""
        place = self.root / path
        with _told(place, "removed"), contextlib.suppress(NotADirectoryError):
            try:
                place.unlink(missing_ok=True)
            except IsADirectoryError:
                place.rmdir()

    def sizes(self) -> dict[str, int]:
        """Every file with its size in bytes. Raises OutputError for a link to a folder: files could
        not be renamed into one on another disk."""
        with _told(self.root, "listed"):
            return dict(self._walk(self.root, ""))

    def names(self, folder: str = "") -> list[str]:
        """What lies in the place itself, or in one of its folders; nothing where that is none."""
        with _told(self.root, "listed"):
            try:
                return [name for name in os.listdir(self.root / folder) if name != _RECOVERED]
            except (FileNotFoundError, NotADirectoryError):
                return []

    def _walk(self, folder: Path, prefix: str) -> Iterator[tuple[str, int]]:
        for entry in os.scandir(folder):
            if not prefix and (entry.name.startswith(ASIDE) or entry.name in (LOCK, _RECOVERED)):
                continue
            linked = entry.is_symlink() and os.path.isdir(entry.path)
            if linked and "." not in entry.name:  # our files have endings, and our folders none
                raise OutputError(
                    f"{entry.path}: is a link to a folder; put the folder itself there, or "
                    "link the whole dataset"
                )
            if entry.is_dir(follow_symlinks=False):
                yield from self._walk(Path(entry.path), f"{prefix}{entry.name}/")
            else:
                broken = entry.is_symlink() and not os.path.exists(entry.path)
                yield f"{prefix}{entry.name}", 0 if broken else entry.stat().st_size

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder for one run, and clear away what a killed run left aside.

        The system lets go of the lock when the process dies. Raises OutputError while another run
        holds it.
        """
        path = self.root / LOCK
        with _told(path, "written"):
            stream = path.open("w")
        with stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # whoever held it before may have removed the file that we opened
                held = os.path.samestat(os.fstat(stream.fileno()), path.stat())
            except OSError:
                held = False
            if not held:
                raise OutputError(
                    f"{self.root}: another run works on this folder; wait for it, or stop it"
                )
            try:
                self._clear()
                yield
            finally:
                self._clear()
                path.unlink(missing_ok=True)

    def _clear(self) -> None:
        for left in self.root.glob(f"{ASIDE}*"):
            shutil.rmtree(left, ignore_errors=True)
        for left in self.root.rglob(ASIDE_FILES):
            left.unlink(missing_ok=True)


class Remote:
    """A dataset at an fsspec address such as s3://bucket/folder. A put there is all or nothing."""

    def __init__(self, address: str) -> None:
        try:
            import fsspec
        except ImportError:
            raise OutputError(
                f"{address}: addresses need fsspec: pip install 'fastgen[remote]'"
            ) from None
        self.root = address
        try:
            self._system, self._base = fsspec.core.url_to_fs(address)
        except Exception as error:  # each store has errors of its own
            raise OutputError(f"{address}: {_words(error)}") from None

    @property
    def lives_here(self) -> bool:
        """Whether it is this process's memory, which no other process sees."""
        return "memory" in self._system.protocol  # a name or several

    @property
    def _has_buckets(self) -> bool:
        """Whether a path begins with a bucket: needs no folders, and asked for one, a mistyped
        bucket would be made."""
        protocol = self._system.protocol
        return not _BUCKETS.isdisjoint({protocol} if isinstance(protocol, str) else protocol)

    def commit(self, files: Files, name: str) -> None:
        """Put one file after the other."""
        for path, content in files.items():
            data = files[content.path] if isinstance(content, Same) else content
            assert isinstance(data, bytes)
            self.write(path, [data])

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Put one file; it appears when all of it has arrived."""
        with self._told(path, "written"):
            if not self._has_buckets:
                self._system.makedirs(self._path(path).rsplit("/", 1)[0], exist_ok=True)
            with self._system.open(self._path(path), "wb") as stream:
                for piece in pieces:
                    stream.write(piece)

    def make_folders(self, paths: Iterable[str]) -> None:
        """Nothing: an address has no folders, only names with slashes."""

    def read(self, path: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        with self._told(path, "read"):
            data: bytes = self._system.cat_file(self._path(path))
        return data

    def remove(self, path: str) -> None:
        """Be without a file, whether it was there or not."""
        with self._told(path, "removed"), contextlib.suppress(FileNotFoundError):
            self._system.rm_file(self._path(path))

    def sizes(self) -> dict[str, int]:
        """Every file with its size in bytes. Raises OutputError for a link to a folder: files could
        not be renamed into one on another disk."""
        with self._told("", "listed"):
            self._system.invalidate_cache()
            if not self._system.exists(self._base):
                return {}
            found: dict[str, dict[str, Any]] = self._system.find(self._base, detail=True)
        skip = len(self._base.rstrip("/")) + 1
        return {path[skip:]: int(entry["size"]) for path, entry in found.items()}

    def names(self, folder: str = "") -> list[str]:
        """What lies in the place itself, or in one of its folders; nothing where that is none."""
        with self._told("", "listed"):
            self._system.invalidate_cache()
            path = self._path(folder).rstrip("/")
            try:
                found: list[str] = self._system.ls(path, detail=False)
            except (FileNotFoundError, NotADirectoryError):
                return []
        return [name.rstrip("/").rpartition("/")[2] for name in found]

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Addresses have no locks that go when their holder dies: two runs make the same bytes."""
        yield

    def _path(self, path: str) -> str:
        return f"{self._base.rstrip('/')}/{path}"

    def _told(self, path: str, deed: str) -> contextlib.AbstractContextManager[None]:
        # each store has errors of its own
        return _told(f"{self.root}/{path}" if path else self.root, deed, Exception)


def storage_of(out: str | Path) -> Folder | Remote:
    """The storage at a path or an address with '://'; files of this machine are a folder's."""
    text = str(out).removeprefix("file://")
    return Remote(text) if "://" in text else Folder(Path(text))


@contextlib.contextmanager
def _told(place: Path | str, deed: str, errors: type[Exception] = OSError) -> Iterator[None]:
    """Failures become OutputErrors that name the place; a file to be read may be missing."""
    try:
        yield
    except FastgenError:
        raise
    except errors as error:
        if deed == "read" and isinstance(error, FileNotFoundError | NotADirectoryError):
            raise FileNotFoundError(str(place)) from None
        raise OutputError(f"{place}: cannot be {deed} ({_words(error)})") from None


def _words(error: Exception) -> str:
    """What an error says of itself, without the place."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error) or type(error).__name__


def _link(source: str, target: str) -> None:
    """A second name for `source`, or a copy where the file system has no links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _flush(folder: Path) -> None:
    """Have the file system of `folder` write out what it holds back; Linux syncfs(2)."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        if ctypes.CDLL(None, use_errno=True).syncfs(handle):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    finally:
        os.close(handle)
