"""Warnings about a dataset, each with what to do about it."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fastgen.report.labels import LabelTable
from fastgen.report.looks import Look, near_duplicates
from fastgen.sampling.scene import SPLITS

SMALL_PX = 8
"""Shorter side below which a detector sees hardly more than a dot."""

_SMALL_SHARE = 0.25
_FEW = 50
"""Labels in the training split below which a class is hardly learned."""

_RARE = 0.1
_BADLY_CLIPPED = 0.35
_DARK_STOPS, _BRIGHT_STOPS = -4.0, 2.0
_NAMED = 6
"""Names that a warning lists at most."""


class Advice(NamedTuple):
    """A finding in one sentence, and what to do about it in another."""

    finding: str
    advice: str


def advice_on(
    manifest: Mapping[str, Any], table: LabelTable, looks: Sequence[Look], scale: float
) -> list[Advice]:
    """Return the warnings about a dataset, the most important first.

    Args:
        manifest: Content of dataset.json.
        table: Its labels, or those of a sample of its images.
        looks: Some of its images.
        scale: Number of the dataset's images for each image in `table`.
    """
    found = [
        _failed(manifest),
        _empty_splits(manifest),
        *_under_represented(manifest, table, scale),
        _too_small(table),
        _duplicates(looks),
        *_exposure(looks),
    ]
    return [each for each in found if each is not None]


def _failed(manifest: Mapping[str, Any]) -> Advice | None:
    scenes = sorted({each["scene"] for each in manifest["failed"]})
    if not scenes:
        return None
    return Advice(
        f"{len(scenes)} scenes could not be rendered: {_list(scenes)}.",
        "fastgen verify says why; change the settings that it names and generate again.",
    )


def _empty_splits(manifest: Mapping[str, Any]) -> Advice | None:
    empty = [split for split in SPLITS if not manifest["counts"].get(split, {}).get("images")]
    if not empty:
        return None
    return Advice(
        f"No image is in {' and '.join(empty)}.",
        "Generate more scenes, or give other fractions with --split; a model that is chosen or "
        "scored on training images looks better than it is.",
    )


def _under_represented(
    manifest: Mapping[str, Any], table: LabelTable, scale: float
) -> list[Advice]:
    counts = table.counts() * scale
    train = counts[:, SPLITS.index("train")]
    found = []
    for task in table.tasks:
        listed = [index for index in table.listed if table.classes[index].task == task]
        targets = [index for index in listed if table.classes[index].is_target]
        if not targets:
            continue
        usual = float(np.median(train[targets]))
        absent = [table.classes[i].name for i in targets if counts[i].sum() == 0]
        rare = [
            f"{table.classes[i].name} ({round(train[i])})"
            for i in targets
            if counts[i].sum() and (train[i] < _FEW or train[i] < _RARE * usual)
        ]
        raised = _raised(manifest, task)
        if absent:
            found.append(
                Advice(
                    f"{task}: no label at all of {_list(absent)}.",
                    f"Generate more images, {raised}, or leave the classes out of the training.",
                )
            )
        if rare:
            found.append(
                Advice(
                    f"{task}: few training labels of {_list(rare)}.",
                    f"Fewer than {_FEW} labels, or a tenth of the usual class, are hardly learned. "
                    f"Generate more images, or {raised}.",
                )
            )
    return found


def _raised(manifest: Mapping[str, Any], task: str) -> str:
    """Return advice on the key that gives more labels of a task, as in 'raise KEY'."""
    part, key = ("damage", "probability") if task == "damage" else ("markings", "marked_containers")
    if manifest.get("config", {}).get(part, {}).get(key) != 1:
        return f"raise {part}.{key}"
    more = "damage.count" if task == "damage" else "markings.markers_per_face"
    return f"raise {more} ({part}.{key} is 1 already)"


def _too_small(table: LabelTable) -> Advice | None:
    small = []
    for index, each in enumerate(table.classes):
        sides = table.smallest_sides(index)
        share = float((sides < SMALL_PX).mean()) if len(sides) else 0.0
        if each.is_target and share > _SMALL_SHARE:
            small.append(f"{each.name} ({share:.0%})")
    if not small:
        return None
    return Advice(
        f"Many boxes are narrower than {SMALL_PX} pixels: {_list(small)}.",
        "Raise --size, shorten cameras.NAME.distance_mm, or raise labels.min_visible_px so that "
        "they are ignored.",
    )


def _duplicates(looks: Sequence[Look]) -> Advice | None:
    pairs = near_duplicates(looks)
    if not pairs:
        return None
    return Advice(
        f"{len(pairs)} pairs of the {len(looks)} images that were looked at are near duplicates: "
        f"{_list([' and '.join(pair) for pair in pairs])}.",
        "Give parts of a dataset different seeds, and vary camera, paint and light more; near "
        "duplicates in different splits spoil the scores.",
    )


def _exposure(looks: Sequence[Look]) -> list[Advice]:
    dark = [look for look in looks if look.exposure_stops < _DARK_STOPS]
    bright = [
        look
        for look in looks
        if look.exposure_stops > _BRIGHT_STOPS or look.clipped > _BADLY_CLIPPED
    ]
    found = []
    for group, word, key in (
        (dark, "almost black", "cameras.NAME.exposure_ev, or use other HDRIs"),
        (bright, "overexposed", "cameras.NAME.exposure_ev"),
    ):
        if len(group) > max(1, 0.05 * len(looks)):
            environments = sorted({look.environment for look in group})
            found.append(
                Advice(
                    f"{len(group)} of the {len(looks)} images that were looked at are {word}, "
                    f"with the HDRIs {_list(environments)}.",
                    f"Change {key}, unless real cameras give such images too.",
                )
            )
    return found


def _list(names: Sequence[object]) -> str:
    shown = ", ".join(map(str, names[:_NAMED]))
    return shown if len(names) <= _NAMED else f"{shown} and {len(names) - _NAMED} more"
