"""Class names with their order in the label formats, and the values of masks and id targets."""

from collections.abc import Iterable, Sequence

from fastgen import plugins

MARKER_CLASSES = (
    *("C1.1", "C1.2", "C1.3", "C1.4", "C2.1", "C2.2", "C2.3", "C2.4", "C2.5", "C3.1", "C3.2"),
    *("C4.1", "C4.2", "C4.3", "C4.4", "C5.1", "C5.2", "C5.3", "C6.1", "C6.2"),
    *("C7.1", "C7.2", "C7.3", "C7.4", "C8.1", "C9.1"),
)
"""The 26 dangerous-goods markers; SeaFront paper, Fig. 3 and Table 9."""

DETECTION_CLASSES = ("container", "text", *MARKER_CLASSES)
"""The 28 classes of the marker task, in the order of YOLO labels."""

CLASS_NAME = "[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}"
"""Pattern of class names. Label files separate names by spaces."""

MARK_CLASSES = (
    "limited_quantity",
    "environmentally_hazardous",
    "elevated_temperature",
    "fumigation_warning",
    "lithium_battery",
)
"""Marks of the IMDG Code that do not tell the class: 3.4.5, 5.2.1.6, 5.3.2.2, 5.5.2.3.2, 5.2.1.10.
They are drawn and labelled only where a configuration has `markings.marks`."""

ALL_DETECTION_CLASSES = (*DETECTION_CLASSES, *MARK_CLASSES)
"""Classes of the marker task with the marks; the first 28 are DETECTION_CLASSES."""

DAMAGE_CLASSES = ("axis", "concave", "dented", "perforation")
"""The four kinds of the SeaFront paper, section 3.3.2."""

DRAWN_DAMAGE_CLASSES = (*DAMAGE_CLASSES, "scrape")
"""Kinds that every damage program of the renderer can draw. Programs for others are compiled when a
configuration or scene has them."""

BUNDLED_DAMAGE_CLASSES = (
    *DRAWN_DAMAGE_CLASSES,
    "rust_through",
    "missing_paint",
    "graffiti",
    "door_gear",
)
"""Kinds of fastgen; each is a module of fastgen.damages. New ones are appended."""

DAMAGE_GROUP = "fastgen.damages"
"""Group of entry points by which packages offer kinds of damage."""

PACKAGE_DAMAGE_CLASSES = tuple(plugins.names(DAMAGE_GROUP))
"""Names of the kinds of installed packages. Reading them does not load the packages."""

ALL_DAMAGE_CLASSES = tuple(dict.fromkeys((*BUNDLED_DAMAGE_CLASSES, *PACKAGE_DAMAGE_CLASSES)))
"""All kinds: those of fastgen, then those of packages in alphabetical order. Scenes have only the
paper's unless `damage.kinds` lists others."""

SEGMENTATION_CLASSES = ("container", *DAMAGE_CLASSES)
"""The SeaFront paper's classes of the damage task, which every dataset has first in YOLO labels.
`segmentation_classes` adds the kinds of damage that a configuration lists besides."""

ALL_SEGMENTATION_CLASSES = ("container", *ALL_DAMAGE_CLASSES)
"""COCO category i + 1 is ALL_SEGMENTATION_CLASSES[i]; mask value is category * 100 + instance. The
first five are SEGMENTATION_CLASSES."""

MOST_DAMAGE_CLASSES = 250
"""Most kinds that labels can number: semantic masks have 8 bits, and mask values stay below
SPREADER_ID."""


def segmentation_classes(kinds: Iterable[str]) -> tuple[str, ...]:
    """Return the classes of the damage task, in label order, if these kinds of damage may occur.

    The paper's five classes always come first. Later classes follow up to the last one that occurs.
    """
    last = max((ALL_SEGMENTATION_CLASSES.index(kind) for kind in kinds), default=0)
    return ALL_SEGMENTATION_CLASSES[: max(last + 1, len(SEGMENTATION_CLASSES))]


UNDAMAGED_CONTAINER = 101
"""Mask value of the undamaged container: category 1, instance 1 (SeaFront paper, 3.3.4)."""

DAMAGE_VALUES = range(200, (len(ALL_SEGMENTATION_CLASSES) + 1) * 100)
"""Mask values of damages: category * 100 + instance. They are also the ids of damages."""

UNDAMAGED_CLASSES = ("container", "text", "spreader", "seal")
"""Classes of labels that are neither damages nor decals with artwork."""

OTHER_CLASSES = frozenset({*ALL_DAMAGE_CLASSES, "spreader", "seal"})
"""Classes of labels that do not belong to the marker task."""


def with_marks(classes: Sequence[str]) -> tuple[str, ...]:
    """Return classes of the marker task, followed by the marks that are not among them."""
    return (*classes, *(name for name in MARK_CLASSES if name not in classes))


def is_detection(name: str) -> bool:
    """Return whether a class belongs to the marker task; any name may be a user's own class."""
    return name not in OTHER_CLASSES


CONTAINER_ID = 1
"""Id of the container. In the id target, 0 is ground, props and panorama; decals start at 2."""

SPREADER_ID = 60000
"""Id of the spreader, above those of all decals."""

SEAL_ID = 60001
"""Id of a seal on the first hasp; those on the other hasps follow."""

BACKGROUND_ID = 100000
"""Ids of background containers start above it. They are not in the id target."""
