"""Where a dataset lies: a folder, or any address that fsspec knows. Files arrive whole or not."""

import contextlib
import ctypes
import fcntl
import os
import shutil
import uuid
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from fastgen.errors import OutputError
from fastgen.formats import Files, Same

ASIDE = ".aside"
"""Prefix of folders where files wait until all of their shard are on the disk."""

LOCK = ".lock"


class Storage(Protocol):
    """What the rest asks of a place. Paths are relative, with forward slashes."""

    def commit(self, files: Files, name: str) -> None:
        """Put all files in place; each is there whole or not at all, whatever happens meanwhile."""
        ...

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Put one file in place, whole or not at all."""
        ...

    def make_folders(self, paths: Iterable[str]) -> None:
        """Have these folders even where nothing is in them."""
        ...

    def read(self, path: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        ...

    def sizes(self) -> Mapping[str, int]:
        """Every file by path with its size in bytes, those set aside left out."""
        ...


class Folder:
    """A dataset in a folder of this machine."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def commit(self, files: Files, name: str) -> None:
        """Write aside, flush, rename. name: distinguishes this commit from others under way."""
        aside = self.root / f"{ASIDE}-{name}-{uuid.uuid4().hex}"
        try:
            for path, content in files.items():
                target = aside / path
                target.parent.mkdir(parents=True, exist_ok=True)
                if isinstance(content, Same):
                    _link(aside / content.path, target)
                else:
                    target.write_bytes(content)
            _flush(aside)
            for path in files:
                (self.root / path).parent.mkdir(parents=True, exist_ok=True)
                _move(aside / path, self.root / path)
        except FileNotFoundError as error:
            raise OutputError(f"{self.root}: vanished while it was written ({error})") from None
        except OSError as error:
            raise OutputError(f"{self.root}: cannot be written ({error.strerror})") from None
        finally:
            shutil.rmtree(aside, ignore_errors=True)

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Written aside, flushed, renamed."""
        target = self.root / path
        # two processes may write the same file where one was given up but lives on
        aside = target.with_name(f".{target.name}.{uuid.uuid4().hex}.part")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with aside.open("wb") as stream:
                for piece in pieces:
                    stream.write(piece)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(aside, target)
        except OSError as error:
            with contextlib.suppress(OSError):
                aside.unlink(missing_ok=True)
            raise OutputError(f"{target}: cannot be written ({error.strerror})") from None

    def make_folders(self, paths: Iterable[str]) -> None:
        """Have these folders even where nothing is in them."""
        for path in paths:
            (self.root / path).mkdir(parents=True, exist_ok=True)

    def read(self, path: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        return (self.root / path).read_bytes()

    def sizes(self) -> dict[str, int]:
        """Every file with its size in bytes."""
        return dict(self._walk(self.root, ""))

    def _walk(self, folder: Path, prefix: str) -> Iterator[tuple[str, int]]:
        for entry in os.scandir(folder):
            if not prefix and (entry.name.startswith(ASIDE) or entry.name == LOCK):
                continue
            if entry.is_dir(follow_symlinks=False):
                yield from self._walk(Path(entry.path), f"{prefix}{entry.name}/")
            else:
                yield f"{prefix}{entry.name}", entry.stat().st_size

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder for one run, and clear away what a killed run left aside.

        The system lets go of the lock when the process dies. Raises OutputError while another run
        holds it.
        """
        path = self.root / LOCK
        with path.open("w") as stream:
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
        for left in self.root.rglob(".*.part"):
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
        except (ImportError, ValueError) as error:
            raise OutputError(f"{address}: {error}") from None

    def commit(self, files: Files, name: str) -> None:
        """Put one file after the other."""
        for path, content in files.items():
            data = files[content.path] if isinstance(content, Same) else content
            assert isinstance(data, bytes)
            self.write(path, [data])

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Put one file; it appears when all of it has arrived."""
        try:
            self._system.makedirs(self._path(path).rsplit("/", 1)[0], exist_ok=True)
            with self._system.open(self._path(path), "wb") as stream:
                for piece in pieces:
                    stream.write(piece)
        except OSError as error:
            raise OutputError(f"{self.root}/{path}: cannot be written ({error})") from None

    def make_folders(self, paths: Iterable[str]) -> None:
        """Nothing: an address has no folders, only names with slashes."""

    def read(self, path: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        data: bytes = self._system.cat_file(self._path(path))
        return data

    def sizes(self) -> dict[str, int]:
        """Every file with its size in bytes."""
        self._system.invalidate_cache()
        if not self._system.exists(self._base):
            return {}
        found: dict[str, dict[str, Any]] = self._system.find(self._base, detail=True)
        skip = len(self._base.rstrip("/")) + 1
        return {path[skip:]: int(entry["size"]) for path, entry in found.items()}

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Addresses have no locks that go when their holder dies: two runs make the same bytes."""
        yield

    def _path(self, path: str) -> str:
        return f"{self._base.rstrip('/')}/{path}"


def storage_of(out: str | Path) -> Folder | Remote:
    """The storage at a path or an address with '://'."""
    text = str(out)
    return Remote(text) if "://" in text else Folder(Path(text))


def _link(source: Path, target: Path) -> None:
    """A second name for `source`, or a copy where the file system has no links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _move(source: Path, target: Path) -> None:
    os.replace(source, target)
    # POSIX leaves the old name where both are one file already
    source.unlink(missing_ok=True)


def _flush(folder: Path) -> None:
    """Have the file system of `folder` write out what it holds back; Linux syncfs(2)."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        if ctypes.CDLL(None, use_errno=True).syncfs(handle):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    finally:
        os.close(handle)
