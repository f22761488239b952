"""`fastgen merge`: one dataset from several finished ones.

The merged dataset has all shards of the others under new numbers, and its own files over whole
splits. Image files are hard links. Images whose names lack the seed get it, because other datasets
have images with the same names. Images are numbered anew for the same reason. Files that contain
what changed are written anew.
"""

import contextlib
import os
import re
import shutil
import tarfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from fastgen import __version__
from fastgen.config.config import Config
from fastgen.dataset.addresses import place_of
from fastgen.dataset.dataset_json import shard_manifest
from fastgen.dataset.finish import finish
from fastgen.dataset.finished import open_finished
from fastgen.dataset.job import Job, manifest_path, scene_and_camera
from fastgen.dataset.progress import Progress
from fastgen.dataset.renaming import Renaming
from fastgen.dataset.seal import Sums, digest, seal
from fastgen.dataset.storage import LOCK, Folder
from fastgen.errors import ConfigError, OutputError
from fastgen.formats.format import Files
from fastgen.formats.parquet import opened_table
from fastgen.formats.registry import formats_of, unknown_format

_RESULTS = ("images", "counts", "failed", "files", "shards", "digest")
"""Keys of dataset.json that do not say how the dataset was made."""


def merge(sources: Sequence[str], out: str) -> dict[str, Any]:
    """Merge finished datasets into a new one. The sources do not change.

    The new dataset appears when it is complete. Its files share their disk space with those of the
    sources if they are on the same file system.

    Args:
        sources: Folders of two or more datasets with the same layout, formats and classes.
        out: Folder of the merged dataset, which is new or empty.

    Returns:
        The content of the new dataset.json.

    Raises:
        OutputError: A source is not a finished dataset or has damaged files, the sources do not fit
            together, or `out` is not a place for them.
    """
    parts = [_part(each) for each in sources]
    root = _new_place(out, parts)
    config = _check_alike(parts)
    _check_names(parts)
    _check_columns(parts)
    first = parts[0].manifest
    job = Job(
        out=out,
        images=sum(part.manifest["images"] for part in parts),
        config=config,
        layout=first["format"],
        tasks=tuple(first["formats"]),
    )
    from fastgen import __version__

    settings = {
        "version": __version__,
        "format": first["format"],
        "formats": first["formats"],
        "classes": _classes(parts[0]),
        "merged_from": [each for part in parts for each in part.made_with],
    }
    with _appearing(root) as storage:
        count = _copy_shards(parts, storage, job.images)
        result = finish(job, storage, settings, count)
        storage.flush()
    return result


@dataclass(frozen=True)
class _Part:
    """One of the datasets to merge, and the content of its dataset.json."""

    out: str
    storage: Folder
    manifest: dict[str, Any]

    @property
    def made_with(self) -> list[dict[str, Any]]:
        """Settings of the dataset; several entries if it was merged itself."""
        own = {key: value for key, value in self.manifest.items() if key not in _RESULTS}
        own["images"] = self.manifest["images"]
        merged: list[dict[str, Any]] = self.manifest.get("merged_from", [own])
        return merged

    @property
    def shards(self) -> Iterator[dict[str, Any]]:
        """The manifests of the shards."""
        for number, hashed in self.manifest["shards"].items():
            path = manifest_path(int(number))
            manifest = shard_manifest(self.intact(path, hashed), int(number))
            if manifest is None:
                raise self.damaged(path)
            for record in manifest["records"]:
                if "number" not in record:  # version 0.30 and earlier
                    record["number"] = self._number(record["stem"])
            yield manifest

    def _number(self, stem: str) -> int:
        """Return the number of an image by its name, if the dataset was not merged."""
        scene, camera = scene_and_camera(stem)
        cameras: list[str] = self.manifest.get("cameras", ())
        if camera not in cameras:
            raise OutputError(f"{self.out}: is damaged; run fastgen verify {self.out}")
        return scene * len(cameras) + cameras.index(camera)

    def config(self) -> Config:
        """Return the configuration, of the first source if the dataset was merged itself."""
        made_with = self.made_with[0]
        try:
            return Config.from_values(made_with["config"])
        except ConfigError as error:
            version = made_with["version"]
            how = "with that version and its packages"
            if version == __version__:
                how = "with the packages that were installed then"
            raise OutputError(
                f"{self.out}: was made by fastgen {version}, whose configuration cannot be read "
                f"({error}); merge {how}"
            ) from None

    def intact(self, path: str, hashed: str) -> bytes:
        """Return the content of a file."""
        with self._damaged_if_unreadable(path):
            content = self.storage.read(path)
        if digest(content) != hashed:
            raise self.damaged(path)
        return content

    def check(self, path: str, hashed: str) -> None:
        """Raise OutputError if a file, which may be larger than memory, was changed."""
        with self._damaged_if_unreadable(path):
            same = self.storage.content_hash(path) == hashed
        if not same:
            raise self.damaged(path)

    @contextlib.contextmanager
    def opened(self, path: str) -> Iterator[BinaryIO]:
        """Open an archive, whose errors in the block become those of a damaged file."""
        with contextlib.ExitStack() as stack:
            with self._damaged_if_unreadable(path):
                stream = stack.enter_context(self.storage.opened(path))
            try:
                yield stream
            except (tarfile.TarError, ValueError):
                raise self.damaged(path) from None

    def link(self, path: str, hashed: str, storage: Folder, new_path: str) -> None:
        """Make a hard link to a file, or a copy of it, in another dataset."""
        self.check(path, hashed)
        storage.adopt(self.storage, path, new_path)

    def damaged(self, path: str) -> OutputError:
        """Return the error for a file that is not as it was written."""
        return OutputError(
            f"{self.out}: {path} is missing or was changed; run fastgen verify {self.out} --repair"
        )

    @contextlib.contextmanager
    def _damaged_if_unreadable(self, path: str) -> Iterator[None]:
        try:
            yield
        except (FileNotFoundError, OutputError):
            raise self.damaged(path) from None


def _part(out: str) -> _Part:
    """Open one of the datasets to merge."""
    place = place_of(out)
    if "://" in place:
        raise OutputError(
            f"{out}: is an address; merge works on folders, so copy the dataset first"
        )
    dataset = open_finished(out)
    unknown = unknown_format(dataset.manifest["formats"])
    if unknown is not None:
        raise OutputError(
            f"{out}: has labels of the format {unknown}, which is unknown; install the package "
            "that offers it"
        )
    return _Part(out, Folder(Path(place)), dataset.manifest)


def _new_place(out: str, parts: Sequence[_Part]) -> Path:
    """Return the folder for the merged dataset after checks."""
    if len(parts) < 2:
        raise OutputError(f"{parts[0].out}: is only one dataset; give two or more, and then OUT")
    place = place_of(out)
    if "://" in place:
        raise OutputError(f"{out}: is an address; merge into a folder, then copy it")
    root = Path(place)
    if root.is_symlink() or (root.exists() and not root.is_dir()):
        raise OutputError(f"{out}: is not a folder; give a new one")
    if root.is_dir() and any(root.iterdir()):
        raise OutputError(f"{out}: is not empty; give a new folder")
    folders: dict[Path, str] = {}
    for part in parts:
        folder = part.storage.root.resolve()
        if folder in folders:
            raise OutputError(f"{part.out}: is given twice; give each dataset once")
        if root.resolve().is_relative_to(folder):
            raise OutputError(f"{out}: is inside {part.out}; give a folder elsewhere")
        folders[folder] = part.out
    return root


def _check_alike(parts: Sequence[_Part]) -> Config:
    """Check that datasets fit together, and return a configuration with their classes."""
    first = parts[0]
    config, classes = first.config(), _classes(first)
    for part in parts[1:]:
        for key, option in (("format", "--format"), ("formats", "--tasks and --also")):
            ours, theirs = first.manifest[key], part.manifest[key]
            if ours != theirs:
                raise OutputError(
                    f"{part.out}: has the {key} {_listed(theirs)}, {first.out} has "
                    f"{_listed(ours)}; generate both with the same {option}"
                )
        for task, names in _classes(part).items():
            if names != classes.get(task):
                only = sorted(set(names) ^ set(classes.get(task, ())))
                what = ", ".join(only) if only else "the order"
                raise OutputError(
                    f"{part.out}: its classes of the {task} task differ from those of {first.out} "
                    f"({what}); generate both with configurations that have the same classes"
                )
    return config


def _classes(part: _Part) -> dict[str, list[str]]:
    """Return the class names of each task; dataset.json of an older version has none."""
    listed = part.manifest.get("classes") or part.config().classes
    return {task: list(names) for task, names in listed.items()}


def _listed(value: str | Sequence[str]) -> str:
    return value if isinstance(value, str) else ", ".join(value)


def _numbered_shards(parts: Sequence[_Part]) -> Iterator[tuple[_Part, dict[str, Any], Renaming]]:
    """Yield each shard of each dataset with its new names."""
    number = images = 0
    formats = formats_of(parts[0].manifest["formats"])
    for part in parts:
        for shard in part.shards:
            stems = tuple(shard["images"])
            seedless = any(re.match("[0-9]", stem) for stem in stems)
            prefix = f"s{part.manifest['seed']}_" if seedless else ""
            yield part, shard, Renaming(prefix, stems, (shard["shard"], number), images, formats)
            number += 1
        images += part.manifest["images"]


def _check_names(parts: Sequence[_Part]) -> None:
    """Raise OutputError if files of two datasets would get the same path."""
    owners: dict[str, _Part] = {}
    for part, shard, names in _numbered_shards(parts):
        images = tuple(map(names.text, shard["images"]))
        paths = map(names.path, shard["files"])
        others = [path for path in paths if not path.rpartition("/")[2].startswith(images)]
        for name in (*images, *others):
            owner = owners.setdefault(name, part)
            if owner is part:
                continue
            if name in images:
                why = "both have the same seed; generate one of them with another --seed"
            else:
                why = "its name does not contain the seed; generate both without such files"
            raise OutputError(f"{owner.out} and {part.out}: both contain {name}; {why}")


def _check_columns(parts: Sequence[_Part]) -> None:
    """Raise OutputError if tables of two datasets have different columns."""
    if parts[0].manifest["format"] != "parquet":
        return
    first = None
    for part in parts:
        for path in (path for shard in part.shards for path in shard["files"]):
            with part.opened(path) as stream, opened_table(stream) as table:
                schema = table.schema_arrow
            first = schema if first is None else first
            if not schema.equals(first, check_metadata=True):
                unlike = sorted({each.name for each in {*schema} ^ {*first}})
                raise OutputError(
                    f"{part.out}: the columns of {path} differ from those of {parts[0].out} "
                    f"({', '.join(unlike) or 'the features'}); generate both with the same version "
                    "of fastgen and of the packages that it uses"
                )


def _copy_shards(parts: Sequence[_Part], storage: Folder, images: int) -> int:
    """Link or write the files and the manifest of each shard, and return the number of shards."""
    progress = Progress(images)
    number = -1
    try:
        for part, shard, names in _numbered_shards(parts):
            _, number = names.shard
            _copy_shard(part, shard, names, storage)
            progress.add(len(shard["images"]))
    finally:
        progress.close_if_drawn()
    return number + 1


def _copy_shard(part: _Part, shard: dict[str, Any], names: Renaming, storage: Folder) -> None:
    entries: dict[str, Any] = {}
    changed: Files = {}
    for path, (size, hashed) in shard["files"].items():
        new_path = names.path(path)
        entries[new_path] = [size, hashed]
        if names.changes_archive(path):
            part.check(path, hashed)
            with part.opened(path) as stream:
                sums = Sums(names.archive(path, stream))
                storage.write(new_path, sums)
            entries[new_path] = sums.entry()
            continue
        if names.changes_label(path):
            content = part.intact(path, hashed)
            renamed = names.content(content)
            if renamed != content:
                changed[new_path] = renamed
                entries[new_path] = [len(renamed), digest(renamed)]
                continue
        part.link(path, hashed, storage, new_path)
    _, number = names.shard
    if changed:
        storage.commit(changed, f"{number:06d}")
    manifest = {
        **shard,
        "shard": number,
        "images": [names.text(stem) for stem in shard["images"]],
        "files": entries,
        "records": [names.record(record) for record in shard["records"]],
    }
    del manifest["digest"]
    storage.write(manifest_path(number), [seal(orjson.dumps(manifest))])


@contextlib.contextmanager
def _appearing(root: Path) -> Iterator[Folder]:
    """Give a hidden folder beside `root`, which becomes `root` at the end of the block.

    After an error nothing is left.
    """
    aside = root.with_name(f".{root.name}.merging")
    try:
        aside.mkdir(parents=True, exist_ok=True)
        storage = Folder(aside)
        with storage.locked():
            for left in aside.iterdir():  # of a process that was killed
                if left.name != LOCK:
                    shutil.rmtree(left) if left.is_dir() else left.unlink()
            try:
                yield storage
            except BaseException:
                shutil.rmtree(aside, ignore_errors=True)
                raise
        os.replace(aside, root)
    except OSError as error:
        shutil.rmtree(aside, ignore_errors=True)
        raise OutputError(f"{root}: cannot be written ({error.strerror})") from None
