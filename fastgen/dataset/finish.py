"""Last step of a run: files that cover whole splits, the contact sheet, and dataset.json."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from fastgen.dataset.console import hint
from fastgen.dataset.contact_sheet import contact_sheet
from fastgen.dataset.dataset_json import MANIFEST, shard_manifest, unsealed
from fastgen.dataset.job import ARCHIVE_ENDINGS, Job, manifest_path
from fastgen.dataset.seal import Sums, digest, seal
from fastgen.dataset.shards import MADE_BY
from fastgen.dataset.storage import Folder, Storage
from fastgen.errors import OutputError
from fastgen.files.images import png
from fastgen.formats.card import card
from fastgen.formats.format import Format, Record
from fastgen.formats.registry import formats_for
from fastgen.sampling.scene import SPLITS

CONTACT_SHEET = "contact_sheet.png"


def finish(
    job: Job, storage: Storage, settings: dict[str, Any], shard_count: int
) -> dict[str, Any]:
    """Write the files that cover all samples, and dataset.json, which seals them, last.

    Args:
        job: Decides layout, formats and class lists.
        storage: Holds the files of all shards.
        settings: First values of dataset.json.
        shard_count: Number of shards; they are numbered from 0.

    Returns:
        The content of dataset.json.
    """
    formats = formats_for(job.formats, job.config.classes)
    shards: dict[str, str] = {}
    makers: list[dict[str, str]] = []
    failed: list[dict[str, Any]] = []
    images: list[tuple[str, str]] = []
    filled: set[str] = set()
    counts = {split: _count(formats, []) for split in SPLITS}
    for shard in range(shard_count):
        shards[str(shard)], manifest = _manifest(job, storage, shard)
        made_by = {name: manifest[name] for name in MADE_BY}
        if made_by not in makers:
            makers.append(made_by)
        failed += manifest["failed"]
        filled.update(path.rpartition("/")[0] for path in manifest["files"])
        for split in SPLITS:
            records = [record for record in manifest["records"] if record["split"] == split]
            counts[split].update(_count(formats, records))
            if job.layout == "seafront":
                images += [(split, record["stem"]) for record in records]
    files: dict[str, list[Any]] = {}

    def put(path: str, pieces: Iterable[bytes]) -> None:
        sums = Sums(pieces)
        storage.write(path, sums)
        files[path] = sums.entry()

    splits = [split for split in SPLITS if counts[split]["images"]] or SPLITS[:1]
    if job.layout in ARCHIVE_ENDINGS:
        pattern = f"SPLIT-*.{ARCHIVE_ENDINGS[job.layout]}"
        put("README.md", map(str.encode, card(pattern, splits)))
    else:
        for each in formats:
            for path, content in each.shared_files(splits, job.config):
                put(path, [content] if isinstance(content, bytes) else map(str.encode, content))
        for split in SPLITS:
            storage.make_folders([f"images/{split}", f"scenes/{split}"])
            for each in formats:
                storage.make_folders(each.folders(split))
                records_of = _records(job, storage, split, shard_count)
                for path, content in each.dataset_files(split, records_of, job.config):
                    put(path, [content] if isinstance(content, bytes) else map(str.encode, content))
        if isinstance(storage, Folder) and images:
            sheet = contact_sheet(storage.root, images, formats)
            put(CONTACT_SHEET, [png(sheet)])
    result = {
        **settings,
        **makers[0],
        "images": job.images,
        "counts": {split: dict(count) for split, count in counts.items()},
        "failed": failed,
        "files": files,
        "shards": shards,
    }
    storage.write(MANIFEST, [seal(unsealed(result))])
    _say_what_is_empty(job, storage, formats, counts, filled)
    if len(makers) > 1 and "merged_from" not in settings:
        names = " and by ".join(" ".join(made_by.values()) for made_by in makers)
        hint(
            f"{job.out} was rendered by {names}, which may round differently; to get the same "
            "bytes everywhere, generate it anew with one of them"
        )
    return result


def _say_what_is_empty(
    job: Job,
    storage: Storage,
    formats: Iterable[Format],
    counts: dict[str, Counter[str]],
    filled: set[str],
) -> None:
    """Print the splits without images, and the folders of the other splits without files.

    Args:
        job: The job.
        storage: Its place; object stores have no empty folders.
        formats: Its formats.
        counts: Number of images, under "images", of each split.
        filled: Folders that have files.
    """
    used = [split for split in SPLITS if counts[split]["images"]]
    empty = [split for split in SPLITS if split not in used]
    if empty:
        hint(
            f"no image is in {' and '.join(empty)}; more scenes, or other --split "
            "fractions, fill them"
        )
    if isinstance(storage, Folder) and job.layout == "seafront":
        folders = [folder for split in used for each in formats for folder in each.folders(split)]
        bare = [folder for folder in folders if folder not in filled]
        if bare:
            hint(f"empty, because no image has a label for them: {', '.join(bare)}")


def _count(formats: Iterable[Format], records: list[Record]) -> Counter[str]:
    """Count images and labels; every name has a value, without records 0."""
    found = Counter(images=len(records))
    for each in formats:
        found.update(each.counts(record["facts"][each.name] for record in records))
    return found


def _manifest(job: Job, storage: Storage, shard: int) -> tuple[str, dict[str, Any]]:
    """Return the content hash and the content of a shard's manifest."""
    path = manifest_path(shard)
    text = storage.read(path)
    manifest = shard_manifest(text, shard)
    if manifest is None:
        raise OutputError(f"{job.out}: {path} was changed during the run; run generate again")
    return digest(text), manifest


def _records(
    job: Job, storage: Storage, split: str, shard_count: int
) -> Callable[[], Iterator[Record]]:
    def through() -> Iterator[Record]:
        for shard in range(shard_count):
            _, manifest = _manifest(job, storage, shard)
            yield from (record for record in manifest["records"] if record["split"] == split)

    return through
