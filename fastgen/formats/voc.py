"""Pascal VOC labels, one XML file per image; VOC2012 development kit, section 7.

Pixels are numbered from 1, and boxes include their last pixel. Objects one pixel wide or high are
left out: their smallest and largest coordinate are equal, and trainers refuse boxes without area.
"""

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

from fastgen.config.config import Config
from fastgen.formats.format import DatasetFiles, Files, Format, Records, Same
from fastgen.formats.item import Item
from fastgen.overlay import class_color


class _Voc(Format):
    name = "voc"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        width, height = item.sample.view.size
        root = ElementTree.Element("annotation")
        _add(root, "folder", "JPEGImages")
        _add(root, "filename", f"{item.stem}.jpg")
        size = ElementTree.SubElement(root, "size")
        for name, value in (("width", width), ("height", height), ("depth", 3)):
            _add(size, name, value)
        _add(root, "segmented", 0)
        for thing, (x0, y0, x1, y1) in item.detections:
            if x1 - x0 < 2 or y1 - y0 < 2:
                continue
            each = ElementTree.SubElement(root, "object")
            _add(each, "name", thing.class_name)
            _add(each, "pose", "Unspecified")
            _add(each, "truncated", int(thing.truncated))
            _add(each, "occluded", int(thing.occluded))
            _add(each, "difficult", int(thing.ignored))
            box = ElementTree.SubElement(each, "bndbox")
            edges = (("xmin", x0 + 1), ("ymin", y0 + 1), ("xmax", x1), ("ymax", y1))
            for name, value in edges:
                _add(box, name, value)
        ElementTree.indent(root)
        return {
            f"voc/JPEGImages/{item.stem}.jpg": Same(item.image_path),
            f"voc/Annotations/{item.stem}.xml": ElementTree.tostring(root),
        }, None

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        lines = (f"{record['stem']}\n" for record in records())
        yield f"voc/ImageSets/Main/{split}.txt", lines

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        lines = ["# label:color_rgb:parts:actions\n", "background:0,0,0::\n"]
        for name in config.markings.detection_classes:
            lines.append(f"{name}:{','.join(map(str, class_color(name)))}::\n")
        yield "voc/labelmap.txt", lines


def _add(parent: ElementTree.Element, name: str, value: object) -> None:
    ElementTree.SubElement(parent, name).text = str(value)


FORMAT = _Voc()
