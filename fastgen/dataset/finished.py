"""Finished datasets that are opened for reading: their dataset.json and the records of shards."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastgen.dataset.dataset_json import MANIFEST, parsed, read_manifest, without_manifest
from fastgen.dataset.storage import Storage, storage_of
from fastgen.errors import OutputError
from fastgen.formats.format import Record


@dataclass(frozen=True, eq=False)
class FinishedDataset:
    """A dataset whose dataset.json is complete and unchanged.

    Attributes:
        out: Its folder or address.
        storage: Its storage.
        manifest: Content of dataset.json.
    """

    out: str
    storage: Storage
    manifest: dict[str, Any]

    @property
    def shards(self) -> list[int]:
        """Numbers of its shards, in the order of dataset.json."""
        return [int(number) for number in self.manifest["shards"]]

    @property
    def images(self) -> int:
        """Number of its images; those of failed scenes are missing."""
        return sum(count.get("images", 0) for count in self.manifest["counts"].values())

    def records(self, shard: int) -> list[Record]:
        """Return the records of one shard's images.

        Raises:
            OutputError: The shard's manifest is missing or changed.
        """
        manifest = read_manifest(self.storage, shard)
        if manifest is None:
            raise self.damaged()
        records: list[Record] = manifest["records"]
        return records

    def damaged(self) -> OutputError:
        """Return the error for files that are not as they were written."""
        return OutputError(f"{self.out}: is damaged; run fastgen verify {self.out}")


def open_finished(out: str | Path) -> FinishedDataset:
    """Open the dataset in a folder or at an address.

    Raises:
        OutputError: `out` is not a finished dataset, or its dataset.json was changed.
    """
    storage, name = storage_of(out), str(out)
    try:
        manifest = parsed(storage.read(MANIFEST))
    except FileNotFoundError:
        raise without_manifest(storage, name) from None
    dataset = FinishedDataset(name, storage, manifest or {})
    if manifest is None:
        raise dataset.damaged()
    if "digest" not in manifest:
        raise OutputError(f"{name}: the dataset is not finished; run generate again")
    return dataset
