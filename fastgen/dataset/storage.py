"""Storage of a dataset: a folder, or an address that fsspec knows. Writes are all or nothing.

Paths in a storage are relative, with forward slashes.
"""

import contextlib
import ctypes
import fcntl
import hashlib
import io
import os
import shutil
import uuid
import weakref
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from fastgen.dataset.addresses import BUCKETS, place_of
from fastgen.errors import FastgenError, OutputError
from fastgen.files.atomic_file import ASIDE_FILES, whole_file
from fastgen.files.inner_path import check_inner, place_inside
from fastgen.files.plain_file import open_lock, open_plain, read_plain
from fastgen.formats.format import Files, Same
from fastgen.redaction import without_secrets

ASIDE = ".aside"
"""Prefix of temporary folders, where files wait until all files of their shard are on the disk."""

LOCK = ".lock"

_RECOVERED = "lost+found"
"""Folder that some file systems put into the root of a volume."""

_LARGEST_READ, _LARGEST_HASHED = 4 << 30, 256 << 30
"""Largest files in bytes. Tar files, which may be larger than memory, are only hashed."""

_locks: weakref.WeakSet[io.FileIO] = weakref.WeakSet()
"""Lock files that this process has open."""


def _close_locks() -> None:
    for stream in list(_locks):
        stream.close()


# a forked worker that outlives the command would keep the folder locked
os.register_at_fork(after_in_child=_close_locks)


class UnreadableError(OutputError):
    """File of a dataset that exists but cannot be read, so that it has to be made again."""


class Folder:
    """A dataset in a folder of this machine. Paths and links that lead out of it are refused."""

    links = True
    """Files with equal content can share space. A disk without hard links gets copies."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def commit(self, files: Files, name: str) -> None:
        """Write files to a temporary folder, flush them, then rename each into place.

        Args:
            files: Content by path.
            name: Distinguishes this commit from others in progress.
        """
        aside = self.root / f"{ASIDE}-{name}-{uuid.uuid4().hex}"
        # strings, because parsing thousands of paths with pathlib takes longer than the rest
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
            for path in {os.path.dirname(path): path for path in files}.values():
                place_inside(self.root, path).parent.mkdir(parents=True, exist_ok=True)
            for path, place in places.items():
                # rename(2) keeps both names if they are the same file; rmtree removes the old one
                os.replace(place, f"{self.root}/{path}")
        except FileNotFoundError as error:
            raise OutputError(f"{self.root}: was removed during the run ({error})") from None
        except OSError as error:
            raise OutputError(f"{self.root}: cannot be written ({error.strerror})") from None
        finally:
            shutil.rmtree(aside, ignore_errors=True)

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Write one file: to a temporary name first, then flushed and renamed."""
        target = place_inside(self.root, path)
        with _named(target, "written"):
            target.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(target) as stream:
                stream.writelines(pieces)

    def adopt(self, other: "Folder", path: str, new_path: str) -> None:
        """Make a hard link to a file of another dataset, or a copy if there cannot be a link."""
        target = place_inside(self.root, new_path)
        with _readable(other.root, path) as source, _named(target, "written"):
            target.parent.mkdir(parents=True, exist_ok=True)
            _link(str(source), str(target))

    def flush(self) -> None:
        """Flush everything that was written to disk."""
        with _named(self.root, "written"):
            _flush(self.root)

    def make_folders(self, paths: Iterable[str]) -> None:
        """Make these folders unless they exist."""
        for path in paths:
            folder = place_inside(self.root, path, follow=True)
            with _named(folder, "written"):
                folder.mkdir(parents=True, exist_ok=True)

    def read(self, path: str) -> bytes:
        """Return the content of a file.

        Raises:
            FileNotFoundError: It does not exist.
            UnreadableError: It is not a regular file inside the dataset, has more than 4 GiB, or
                cannot be read.
        """
        with _readable(self.root, path) as place:
            return read_plain(place, _LARGEST_READ)

    @contextlib.contextmanager
    def opened(self, path: str) -> Iterator[io.BufferedReader]:
        """Open a file, which may be larger than memory, for reading at any position.

        Raises the errors of `read`.
        """
        with _readable(self.root, path) as place, open_plain(place, _LARGEST_HASHED) as stream:
            yield stream

    def content_hash(self, path: str) -> str:
        """Return the SHA-256 of a file in hexadecimal, without keeping its content in memory.

        Raises the errors of `read`.
        """
        with self.opened(path) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def remove(self, path: str) -> None:
        """Remove a file, or an empty folder with its name, if it exists."""
        place = place_inside(self.root, path)
        with _named(place, "removed"), contextlib.suppress(NotADirectoryError):
            try:
                place.unlink(missing_ok=True)
            except IsADirectoryError:
                if os.listdir(place):
                    raise OutputError(
                        f"{place}: is a folder that is not empty; move it elsewhere"
                    ) from None
                place.rmdir()

    def sizes(self) -> dict[str, int]:
        """Return the size in bytes of every file by its path.

        Raises:
            OutputError: There is a link to a folder. It may lead to another disk, where files
                could not be renamed into place.
        """
        with _named(self.root, "listed"):
            return dict(self._walk(self.root, ""))

    def names(self, folder: str = "") -> list[str]:
        """Return the names in the root or in a folder; none if the folder does not exist."""
        with _named(self.root, "listed"):
            try:
                return [name for name in os.listdir(self.root / folder) if name != _RECOVERED]
            except (FileNotFoundError, NotADirectoryError):
                return []

    def _walk(self, folder: Path, prefix: str) -> Iterator[tuple[str, int]]:
        for entry in os.scandir(folder):
            if not prefix and (entry.name.startswith(ASIDE) or entry.name in (LOCK, _RECOVERED)):
                continue
            linked = entry.is_symlink() and os.path.isdir(entry.path)
            if linked and "." not in entry.name:  # only our files have extensions
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
        """Lock the folder for one run, and remove temporary files of a run that was killed.

        The system releases the lock when the process dies.

        Raises:
            OutputError: Another run holds the lock.
        """
        path = self.root / LOCK
        with _named(path, "written"):
            stream = open_lock(path)
        _locks.add(stream)
        with stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # the previous holder may have removed the file after we opened it
                held = os.path.samestat(os.fstat(stream.fileno()), path.stat())
            except OSError:
                held = False
            if not held:
                raise OutputError(
                    f"{self.root}: another run uses this folder; wait for it, or stop it"
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
    """A dataset at an fsspec address such as s3://bucket/folder, where puts are atomic."""

    links = False

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
            raise OutputError(without_secrets(f"{address}: {_words(error)}", address)) from None

    @property
    def lives_here(self) -> bool:
        """True for memory of this process, which no other process sees."""
        return "memory" in self._system.protocol  # a string or a tuple of strings

    @property
    def _has_buckets(self) -> bool:
        """True if paths begin with a bucket.

        A bucket needs no folders, and making one would create a bucket from a mistyped name.
        """
        protocol = self._system.protocol
        return not BUCKETS.isdisjoint({protocol} if isinstance(protocol, str) else protocol)

    def commit(self, files: Files, name: str) -> None:
        """Write one file after the other. `name` is not used."""
        for path, content in files.items():
            data = files[content.path] if isinstance(content, Same) else content
            assert isinstance(data, bytes)
            self.write(path, [data])

    def write(self, path: str, pieces: Iterable[bytes]) -> None:
        """Write one file, which appears when its upload is complete."""
        with self._named(path, "written"):
            if not self._has_buckets:
                self._system.makedirs(self._path(path).rsplit("/", 1)[0], exist_ok=True)
            with self._system.open(self._path(path), "wb") as stream:
                for piece in pieces:
                    stream.write(piece)

    def make_folders(self, paths: Iterable[str]) -> None:
        """Do nothing: object stores have no folders, only names with slashes."""

    def read(self, path: str) -> bytes:
        """Return the content of a file. Raises FileNotFoundError."""
        with self._named(path, "read"):
            data: bytes = self._system.cat_file(self._path(path))
        return data

    @contextlib.contextmanager
    def opened(self, path: str) -> Iterator[io.BufferedReader]:
        """Open a file for reading at any position. Raises FileNotFoundError."""
        with self._named(path, "read"), self._system.open(self._path(path), "rb") as stream:
            yield stream

    def content_hash(self, path: str) -> str:
        """Return the SHA-256 of a file in hexadecimal, without keeping its content in memory."""
        with self.opened(path) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def remove(self, path: str) -> None:
        """Remove a file if it exists."""
        with self._named(path, "removed"), contextlib.suppress(FileNotFoundError):
            self._system.rm_file(self._path(path))

    def sizes(self) -> dict[str, int]:
        """Return the size in bytes of every file by its path."""
        with self._named("", "listed"):
            self._system.invalidate_cache()
            if not self._system.exists(self._base):
                return {}
            found: dict[str, dict[str, Any]] = self._system.find(self._base, detail=True)
        skip = len(self._base.rstrip("/")) + 1
        return {path[skip:]: int(entry["size"]) for path, entry in found.items()}

    def names(self, folder: str = "") -> list[str]:
        """Return the names in the root or in a folder; none if the folder does not exist."""
        with self._named("", "listed"):
            self._system.invalidate_cache()
            path = self._path(folder) if folder else self._base.rstrip("/")
            try:
                found: list[str] = self._system.ls(path, detail=False)
            except (FileNotFoundError, NotADirectoryError):
                return []
        return [name.rstrip("/").rpartition("/")[2] for name in found]

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Do nothing: object stores have no locks that end with their holder.

        Two runs with the same settings write the same bytes, so they do no harm.
        """
        yield

    def _path(self, path: str) -> str:
        return f"{self._base.rstrip('/')}/{check_inner(path)}"

    def _named(self, path: str, action: str) -> contextlib.AbstractContextManager[None]:
        # each store has errors of its own
        return _named(f"{self.root}/{path}" if path else self.root, action, Exception)


Storage = Folder | Remote


def storage_of(out: str | Path) -> Storage:
    """Return the storage at a path or at an address with '://'; file:// gives a Folder.

    Raises:
        OutputError: `out` is neither a path nor an address; see `place_of`.
    """
    place = place_of(out)
    return Remote(place) if "://" in place else Folder(Path(place))


@contextlib.contextmanager
def _readable(root: Path, path: str) -> Iterator[Path]:
    """Yield the path of a file that is to be read; see `Folder.read` for the errors."""
    try:
        place = place_inside(root, path, follow=True)
    except OutputError as error:
        raise UnreadableError(str(error)) from None
    try:
        yield place
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(str(place)) from None
    except OSError as error:
        raise UnreadableError(f"{place}: cannot be read ({_words(error)})") from None


@contextlib.contextmanager
def _named(place: Path | str, action: str, errors: type[Exception] = OSError) -> Iterator[None]:
    """Turn errors into an OutputError that names the place.

    A missing file that was to be read remains a FileNotFoundError.
    """
    try:
        yield
    except FastgenError:
        raise
    except errors as error:
        if action == "read" and isinstance(error, FileNotFoundError | NotADirectoryError):
            raise FileNotFoundError(str(place)) from None
        words = f"{place}: cannot be {action} ({_words(error)})"
        raise OutputError(without_secrets(words, str(place))) from None


def _words(error: Exception) -> str:
    """Return an error's message without the path."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error) or type(error).__name__


def _link(source: str, target: str) -> None:
    """Make a hard link, or a copy if the file system has no hard links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _flush(folder: Path) -> None:
    """Flush the file system that holds `folder` to disk; see syncfs(2)."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        if ctypes.CDLL(None, use_errno=True).syncfs(handle):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    finally:
        os.close(handle)
