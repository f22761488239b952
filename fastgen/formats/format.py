"""The base class of label formats, the types it uses, and the assembly of one sample's files."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fastgen.config.config import Config
from fastgen.errors import OutputError
from fastgen.formats import coco
from fastgen.formats.item import Item
from fastgen.formats.scene_file import scene_file
from fastgen.overlay import Outline


@dataclass(frozen=True)
class Same:
    """Content of a file that equals another file of the same sample.

    Attributes:
        path: The other file, relative to the dataset.
        link_only: The file is only worth its name: storage without links leaves it out.
    """

    path: str
    link_only: bool = False


Files = dict[str, bytes | Same]
"""Content of files by path relative to the dataset, with forward slashes."""

Record = dict[str, Any]
"""One image as JSON values: stem, split, number in the dataset, size [width, height], and facts by
name of format."""

Records = Callable[[], Iterable[Record]]
"""Returns the records of one split in order; each call starts from the beginning."""

Read = Callable[[str], bytes]
"""Returns the content of a file of a dataset by its path relative to the dataset."""

Label = tuple[str, Sequence[float]]
"""Class name, and box as x, y, width and height in pixels."""

DatasetFiles = Iterator[tuple[str, Iterable[str] | bytes]]
"""Path and content of files that cover many images; the content is bytes or text pieces."""


class Format(ABC):
    """One label format: the files of each sample, and queries about them for dataset code.

    A subclass has one instance, which its module calls FORMAT.

    Attributes:
        name: Name on the command line and key of `Record["facts"]`.
        classes: Class names of its labels in order; empty where labels have no classes.
        needs_normals: `sample_files` reads `Sample.normals`, which cost another draw.
        fits_archives: Layouts that pack samples into archives can hold this format, because
            `sample_files` alone gives everything a reader needs.
        builds_on: Formats whose facts it writes in another form; one of them must be chosen too.
    """

    name: str
    classes: tuple[str, ...] = ()
    needs_normals: bool = False
    fits_archives: bool = True
    builds_on: tuple[str, ...] = ()

    @abstractmethod
    def sample_files(self, item: Item) -> tuple[Files, Any]:
        """Return the files of one sample, and facts about it as JSON values.

        The shard's manifest keeps the facts; the other methods work on them.
        """

    def renumbered(self, path: str, by: int) -> str:
        """Return the path of a sample's file after the number of its image rose.

        Numbers rise when datasets are merged, and `Record["number"]` rises too.

        Args:
            path: Path of a file of any format.
            by: By how much.
        """
        return path

    def with_classes(self, classes: Sequence[str]) -> "Format":
        """Return this format for the class list of a dataset, which a configuration may change."""
        return self

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        """Yield the path and content of each file that covers a whole split.

        Args:
            split: train, val or test.
            records: Returns the records of the split's images.
            config: Configuration of the dataset, which decides the list of classes.
        """
        return iter(())

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        """Yield the path and content of each file that covers all splits, such as class lists.

        Args:
            splits: The splits that have images, at least one.
            config: Configuration of the dataset, which decides the list of classes.
        """
        return iter(())

    def coco_task(self, config: Config) -> coco.Task | None:
        """Return the task whose COCO annotations are this format's facts; None if they are not."""
        return None

    def members(self, item: Item, files: Files, facts: Any) -> Files:
        """Return the files of one sample for an archive, where all samples have the same members.

        Args:
            item: The sample.
            files: The files that `sample_files` returned.
            facts: The facts that it returned.
        """
        return files

    def folders(self, split: str) -> Sequence[str]:
        """Return folders that readers expect even when they are empty."""
        return ()

    def labels(self, facts: Any) -> Iterable[Label]:
        """Return the labels in one image with these facts, except ignored ones."""
        return ()

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        """Count labels over the images with these facts, under the names used in dataset.json.

        Without images, return every name with 0.
        """
        return {}

    def outlines(self, size: tuple[int, int], read: Read, name: str) -> list[Outline]:
        """Return the labels of one image, as its label file has them, for the contact sheet.

        Args:
            size: Width and height of the drawn image in pixels, at any scale.
            read: Returns the content of a file of the dataset by its path.
            name: SPLIT/STEM of the image.

        Raises:
            ValueError, IndexError: The label file cannot be read.
        """
        return []

    def check(self, record: Record, read: Read) -> Iterable[str]:
        """Return a line "PATH: FAULT" for each label file of one image that contradicts others."""
        return ()

    def check_split(self, split: str, facts: list[Any], read: Read) -> Iterable[str]:
        """Return a line "PATH: FAULT" for each file of a split that contradicts the facts.

        Args:
            split: train, val or test.
            facts: Facts of the split's images in order.
            read: Returns the content of a file of the dataset by its path.
        """
        return ()


def crop_lines(name: str, item: Item, crops: Iterable[tuple[Sequence[float], str]]) -> Files:
    """Return a file with a line `coordinates<TAB>words` for each crop of an image.

    Args:
        name: Name of the format.
        item: The image.
        crops: Corners of each crop in pixels, and what it shows.
    """
    lines = [f"{' '.join(f'{v:g}' for v in corners)}\t{words}\n" for corners, words in crops]
    return {f"{name}/{item.split}/{item.stem}.txt": "".join(lines).encode()}


def _failed(each: Format, item: Item, error: Exception) -> str:
    """Return the message about an error in the format of a package."""
    *_, last = traceback.extract_tb(error.__traceback__)
    return (
        f"the format {each.name} of {type(each).__module__} failed at {item.stem}: {error!r} "
        f"({last.filename}:{last.lineno}); mend that package"
    )


def assemble(item: Item, formats: Sequence[Format], archived: bool = False) -> tuple[Files, Record]:
    """Return the files of one sample and its record.

    Args:
        item: The sample.
        formats: Formats to write.
        archived: The files become members of an archive.

    Returns:
        The files, the image first and the scene file last, and the record.
    """
    files: Files = {item.image_path: item.jpeg}
    facts = {}
    for each in formats:
        try:
            more, facts[each.name] = each.sample_files(item)
        except Exception as error:
            if type(each).__module__.startswith("fastgen."):
                raise
            raise OutputError(_failed(each, item, error)) from error
        files.update(each.members(item, more, facts[each.name]) if archived else more)
    record = {
        "stem": item.stem,
        "split": item.split,
        "number": item.number,
        "size": list(item.sample.view.size),
        "facts": facts,
    }
    files[f"scenes/{item.split}/{item.stem}.json"] = scene_file(item)
    return files, record
