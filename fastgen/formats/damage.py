"""Labels of the damage task: 16-bit masks, COCO files and a folder for YOLO segmentation."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import (
    ALL_SEGMENTATION_CLASSES,
    DAMAGE_VALUES,
    UNDAMAGED_CONTAINER,
)
from fastgen.config.config import Config
from fastgen.files.images import decode, png
from fastgen.formats import coco, yolo
from fastgen.formats.format import (
    DatasetFiles,
    Files,
    Format,
    Label,
    Read,
    Record,
    Records,
    Same,
)
from fastgen.formats.item import Item
from fastgen.labels.background import background_masks
from fastgen.labels.visibility import mask_box, window
from fastgen.overlay import Outline
from fastgen.sample import Box, Sample


def instances(sample: Sample) -> Iterator[tuple[int, Box, NDArray[np.bool_], bool]]:
    """Yield the visible containers and each visible damage.

    Yields:
        Value in the damage target, tight box, mask bool [H, W], and whether the instance is
        ignored. The mask of a container includes its damages.
    """
    found = []
    for thing in sample.objects:
        if (
            thing.bbox is None
            or thing.background
            or thing.class_name not in ALL_SEGMENTATION_CLASSES
        ):
            continue
        if thing.class_name == "container":
            mask = sample.container_mask(thing.container)
            found.append((UNDAMAGED_CONTAINER + thing.container, thing.bbox, mask, thing.ignored))
        else:
            mask = np.asarray(sample.damage == thing.id)
            found.append((thing.id, thing.bbox, mask, thing.ignored))
    yield from sorted(found, key=lambda each: each[0])


class _Damage(Format):
    name = "damage"
    classes = ALL_SEGMENTATION_CLASSES

    def with_classes(self, classes: Sequence[str]) -> Format:
        made = _Damage()
        made.classes = tuple(classes)  # the package of a kind may have been removed
        return made

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        found = list(instances(item.sample))
        height, width = item.sample.damage.shape
        outlined = [
            (value // 100, box, window(mask, box))
            for value, box, mask, ignored in found
            if not ignored
        ]
        background = background_masks(item.sample)
        outlined += [(1, box, part) for thing, box, part in background if not thing.ignored]
        lines = []
        for category, box, part in outlined:
            polygon = yolo.outline(part)
            if len(polygon) > 2:
                points = (polygon + box[:2]) / (width, height)
                lines.append(yolo.line(category - 1, points.ravel().tolist()))
        name = f"{item.split}/{item.stem}"
        files: Files = {
            f"damage/masks/{name}.png": png(item.sample.damage),
            **yolo.files("damage", item, "".join(lines)),
            # the place for readers that know images by another folder
            f"damage/yolo/{name}.txt": Same(f"damage/labels/{name}.txt"),
        }
        containers = {UNDAMAGED_CONTAINER + each.container: each.id for each in item.containers}
        facts = [
            item.container_annotations[containers[value]]
            if value in containers
            else item.annotation(value // 100, box, window(mask, box), ignored)
            for value, box, mask, ignored in found
        ]
        return files, facts + item.background_annotations

    def labels(self, facts: Any) -> Iterable[Label]:
        return coco.labels(facts, self.classes)

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        names = (name for each in facts for name, _ in self.labels(each))
        return {"damages": sum(name != "container" for name in names)}

    def folders(self, split: str) -> Sequence[str]:
        folders = ("images", "labels", "masks", "yolo")
        return tuple(f"damage/{each}/{split}" for each in folders)

    def coco_task(self, config: Config) -> coco.Task:
        return coco.Task(
            self.name,
            "Synthetic shipping containers with damage masks",
            [
                {"id": i + 1, "name": name, "supercategory": "damage" if i else "container"}
                for i, name in enumerate(self.classes)
            ],
            len(config.damage.segmentation_classes),
        )

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        yield self.coco_task(config).split_file(split, records)

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        return yolo.task_files("damage", config.damage.segmentation_classes, splits)

    def outlines(self, size: tuple[int, int], read: Read, name: str) -> list[Outline]:
        return [
            Outline(np.reshape(values, (-1, 2)) * size, self.classes[index], self.classes[index])
            for index, values in yolo.finite_rows(read(f"damage/yolo/{name}.txt"))
            if index  # the container shows as a box already
        ]

    def check(self, record: Record, read: Read) -> Iterator[str]:
        name = f"{record['split']}/{record['stem']}"
        # older datasets have no damage/labels
        outlines, mask = f"damage/yolo/{name}.txt", f"damage/masks/{name}.png"
        for fault in _outline_faults(yolo.rows(read(outlines).decode())):
            yield f"{outlines}: {fault}"
        fault = _mask_fault(read(mask), record["size"], record["facts"][self.name])
        if fault:
            yield f"{mask}: {fault}"

    def check_split(self, split: str, facts: list[Any], read: Read) -> Iterator[str]:
        path = f"damage/coco_{split}.json"
        if not coco.has_annotations(read(path), [item for each in facts for item in each]):
            yield f"{path}: differs from the shards' records"


def _outline_faults(found: list[tuple[int, list[float]]]) -> Iterator[str]:
    for index, values in found:
        if not 0 <= index < len(ALL_SEGMENTATION_CLASSES) or len(values) < 6 or len(values) % 2:
            yield f"class {index} with {len(values)} numbers is not an outline"
        elif not (min(values) >= 0 and max(values) <= 1):
            yield "a value lies outside 0..1"


def _mask_fault(png_file: bytes, size: Sequence[int], annotations: list[dict[str, Any]]) -> str:
    """Compare a mask file with annotations; '' if it has the same parts.

    Containers of the panorama are not in the mask.
    """
    width, height = size
    try:
        mask = decode(png_file)
        complete = mask.shape == (height, width) and mask.dtype == np.uint16
    except ValueError:
        complete = False
    if not complete:
        return f"not a complete 16-bit PNG of {width}x{height}"
    annotations = [item for item in annotations if not item.get("background")]
    # the mask does not tell which of several containers a damage is on
    several = sum(item["category_id"] == 1 for item in annotations) > 1
    listed = [item for item in annotations if not (several and item["category_id"] == 1)]
    parts = [(1, mask > 0)] if mask.any() and not several else []
    parts += [(int(v) // 100, mask == v) for v in np.unique(mask[mask >= DAMAGE_VALUES.start])]
    # as the dataset's masks are written
    polygons = any("polygons" in item for item in listed)
    from_mask = []
    for category, part in parts:
        box = mask_box(part)
        assert box is not None
        found = [
            coco.annotation(category, box, window(part, box), (width, height), ignored, polygons)
            for ignored in (False, True)
        ]
        from_mask.append(found)
    same = len(listed) == len(from_mask) and all(
        any(item in found for item in listed) for found in from_mask
    )
    return "" if same else "differs from the COCO annotations"


FORMAT = _Damage()
