"""Sections of the comparison with real pictures, each measured with one seed.

A section trains on fresh renders, and then measures the same on held-out renders ("ours") and on
real pictures ("theirs"). Real pictures are never trained on, and no setting here was chosen by
them.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from box_detector import ap50, best_score, counts, detect, fit_detector
from crop_networks import Classifier, fit_classifier, fit_pairs, fit_reader
from crop_statistics import (
    Array,
    Interval,
    auc_interval,
    joint_scores,
    single_aucs,
    statistics_of,
)
from gap_renders import Effort, Renders
from marker_search import overlap, search, true_scores
from numpy.typing import NDArray
from panel_crops import PANEL_PX, Pixels, change_of, square_crop
from real_crops import DAMAGE_KINDS, LAYOUTS, PanelPair, RealCrops
from rendered_boxes import PRESETS
from rendered_crops import MARKER_PX, Crops
from text import edit_distance

from fastgen.classes import MARKER_CLASSES


class Share(NamedTuple):
    """Number of right answers, and number of all."""

    right: int
    total: int


class Count(NamedTuple):
    """A number of things."""

    value: float


Measure = Share | Interval | Count
Measures = dict[str, Measure]

_BACKGROUND = len(MARKER_CLASSES)
_RECALL = 0.6
_DENTS = ("axis", "concave", "dented")
"""Kinds that the real pictures call a dent."""

_CHANGE_EDGES = (0, 8, 16, 32, 64, 256)
"""Limits of the groups by change_of, in 8-bit levels."""

_MIN_PANELS = 5
_LONGEST = {"photographs": 640, "panels": PANEL_PX, "identifiers": 256}


class Trial:
    """Renders and trained networks of one seed, made when a section first needs them.

    Args:
        real: The real pictures.
        renders: Renders of all seeds.
        seed: Seed of weights and order; it also chooses the training scenes.
        effort: Amount of training.
    """

    def __init__(self, real: RealCrops, renders: Renders, seed: int, effort: Effort) -> None:
        self.real, self.renders, self.seed, self.effort = real, renders, seed, effort
        self.confused: Counter[tuple[str, str]] = Counter()

    @cached_property
    def crops(self) -> Crops:
        """Training crops."""
        return self.renders.crops(self.seed)

    @cached_property
    def marker_model(self) -> Classifier:
        """Classifier of the markers and the background."""
        crops = self.crops
        classes = [MARKER_CLASSES.index(name) for _, name in crops.markers]
        pixels = [crop for crop, _ in crops.markers] + crops.backgrounds
        return fit_classifier(
            np.stack(pixels),
            np.array(classes + [_BACKGROUND] * len(crops.backgrounds)),
            _BACKGROUND + 1,
            self.effort.marker_steps,
            self.seed,
        )


def markers(trial: Trial) -> Measures:
    """Return top-1 accuracy of markers, on ours and theirs, and theirs by class."""
    model, real = trial.marker_model, trial.real.placards
    mine = trial.renders.held_out.markers
    found: Measures = {
        "ours, held out": _top1(model, [c for c, _ in mine], [name for _, name in mine])[0]
    }
    pictures = [
        cv2.resize(p.pixels, (MARKER_PX, MARKER_PX), interpolation=cv2.INTER_AREA) for p in real
    ]
    names = [p.class_name for p in real]
    found["theirs"], guessed = _top1(model, np.array(pictures, np.uint8), names)
    for name in sorted(set(names), key=MARKER_CLASSES.index):
        reads = [guess for guess, truth in zip(guessed, names, strict=True) if truth == name]
        found[f"theirs, {name}"] = Share(reads.count(name), len(reads))
    trial.confused.update(
        (truth, guess) for truth, guess in zip(names, guessed, strict=True) if truth != guess
    )
    return found


def identifiers(trial: Trial) -> Measures:
    """Return exact reads and character errors of a small reader, by layout."""
    reader = fit_reader(trial.crops.texts, trial.effort.reader_steps, trial.seed)
    ours = [(t.framed(), t.layout, t.code) for t in trial.renders.held_out.texts]
    theirs = [(r.pixels, r.layout, r.code) for r in trial.real.identifiers]
    found: Measures = {}
    for whose, texts in (("ours, held out", ours), ("theirs", theirs)):
        read = reader.read([(pixels, layout) for pixels, layout, _ in texts])
        for name in LAYOUTS:
            pairs = [
                (code, got)
                for (_, layout, code), got in zip(texts, read, strict=True)
                if layout == name
            ]
            if pairs:
                exact = sum(code == got for code, got in pairs)
                wrong = sum(edit_distance(got, code) for code, got in pairs)
                found[f"{whose}, {name}, exact"] = Share(exact, len(pairs))
                total = sum(len(code) for code, _ in pairs)
                found[f"{whose}, {name}, character errors"] = Share(wrong, total)
    return found


def false_markers(trial: Trial) -> Measures:
    """Return markers found in photographs without any, at a recall of 60 % on our own images."""
    pixels: list[Pixels] = []
    classes: list[int] = []
    for view in trial.renders.mined:
        found = search(trial.marker_model, view.image)
        near = overlap(found.boxes, view.seen).max(axis=1, initial=0.0)
        for box in found.boxes[near < 0.2][:40]:
            pixels.append(square_crop(view.image, box.tolist(), MARKER_PX))
            classes.append(_BACKGROUND)
    crops = trial.crops
    pixels += [crop for crop, _ in crops.markers] + crops.backgrounds
    classes += [MARKER_CLASSES.index(name) for _, name in crops.markers]
    classes += [_BACKGROUND] * len(crops.backgrounds)
    model = fit_classifier(
        np.stack(pixels),
        np.array(classes),
        _BACKGROUND + 1,
        trial.effort.marker_steps // 2,
        trial.seed,
        start=trial.marker_model,
    )
    ours = [(search(model, view.image), view) for view in trial.renders.views("seafront")]
    scores = np.concatenate([true_scores(f, v.boxes, v.classes) for f, v in ours])
    least = max(float(np.quantile(scores, 1 - _RECALL, method="lower")), 1e-6)
    false = sum(
        int((overlap(f.boxes, v.seen).max(axis=1, initial=0.0)[f.scores >= least] < 0.2).sum())
        for f, v in ours
    )
    photos = [search(model, photo) for photo in trial.real.photos]
    return {
        "recall on ours": Share(int((scores >= least).sum()), len(scores)),
        "score": Count(least),
        "false per image of ours": Count(false / len(ours)),
        "false per photograph": Count(
            sum(int((f.scores >= least).sum()) for f in photos) / len(photos)
        ),
    }


def damage(trial: Trial) -> Measures:
    """Return AUCs of damaged against undamaged panels, on ours and theirs."""
    pairs = trial.crops.panels
    model = fit_pairs(
        np.stack([pair.damaged for pair in pairs]),
        np.stack([pair.undamaged for pair in pairs]),
        trial.effort.damage_steps,
        trial.seed,
    )
    mine, theirs = trial.renders.held_out.panels, trial.real.panels
    found = _by_kind_and_change(*_scores(model, mine), mine)
    damaged, undamaged = _scores(model, theirs)
    found["theirs, all"] = auc_interval(damaged, undamaged)
    for kind in sorted(DAMAGE_KINDS, reverse=True):
        chosen = np.array([p.kind == kind for p in theirs])
        if chosen.any():
            found[f"theirs, {kind}"] = auc_interval(damaged[chosen], undamaged[chosen])
    return found


def _both(pairs: Sequence[PanelPair]) -> list[Pixels]:
    """Return the panels of all pairs, each damaged one before the undamaged one."""
    return [panel for pair in pairs for panel in (pair.damaged, pair.undamaged)]


def _scores(model: Classifier, pairs: Sequence[PanelPair]) -> tuple[Array, Array]:
    """Return the probability [N] that a panel is damaged, for the damaged and the undamaged."""
    size = (PANEL_PX, PANEL_PX)
    panels = [cv2.resize(panel, size, interpolation=cv2.INTER_AREA) for panel in _both(pairs)]
    shares: Array = model.shares(np.array(panels, np.uint8))[:, 1].astype(float)
    return shares[::2], shares[1::2]


def _by_kind_and_change(damaged: Array, undamaged: Array, pairs: Sequence[PanelPair]) -> Measures:
    """Return AUCs on our panels by kind of damage, and by how much the damage changes the panel.

    Each group is compared with all undamaged panels.

    Args:
        damaged: Scores [N] of the damaged panels.
        undamaged: Scores [N] of the undamaged panels.
        pairs: The panels.
    """
    kinds = np.array([pair.kind for pair in pairs])
    change = np.array([change_of(pair.damaged, pair.undamaged) for pair in pairs])
    groups = {
        "all": np.ones(len(kinds), bool),
        "dent": np.isin(kinds, _DENTS),
        **{kind: kinds == kind for kind in sorted(set(kinds))},
        **{
            f"change of {low:g} to {high:g} levels": (change >= low) & (change < high)
            for low, high in pairwise(_CHANGE_EDGES)
        },
    }
    return {
        f"ours, held out, {name}": auc_interval(damaged[chosen], undamaged)
        for name, chosen in groups.items()
        if chosen.sum() >= _MIN_PANELS
    }


def containers(trial: Trial) -> Measures:
    """Return AP50, recall and precision of a detector of containers on ours and theirs.

    Recall and precision are those of detections with at least `score`, which has the best F1 on
    held-out renders.
    """
    model = fit_detector(trial.renders.boxed(trial.seed), trial.effort.box_steps, trial.seed)
    mine = trial.renders.held_out_boxed
    ours = detect(model, mine)
    seen = {
        "ours, held out": ours,
        **{
            f"ours, held out, {name}": ours.where([v.preset == name for v in mine])
            for name in PRESETS
        },
        "theirs": detect(model, trial.real.boxed),
    }
    found: Measures = {f"{name}, AP50": ap50(each) for name, each in seen.items()}
    least = best_score(ours)
    found["score"] = Count(least)
    for name, each in seen.items():
        right, all_found, labels = counts(each, least)
        found[f"{name}, recall"] = Share(right, labels)
        if all_found:
            found[f"{name}, precision"] = Share(right, all_found)
    return found


def image_statistics(trial: Trial) -> Measures:
    """Return AUCs of telling our pictures from theirs, of all statistics together and of each."""
    found: Measures = {}
    for group, ours, theirs in _groups(trial):
        if len(theirs) < 3 or len(ours) < 3:
            continue
        longest = _LONGEST[group.partition(",")[0]]
        names = tuple(statistics_of(ours[0], longest))
        mine, real = (
            np.array([tuple(statistics_of(p, longest).values()) for p in pictures])
            for pictures in (ours, theirs)
        )
        scores = joint_scores(mine, real, trial.seed)
        found[f"{group}, all together"] = auc_interval(*scores, trial.seed)
        for name, value in single_aucs(mine, real, names).items():
            found[f"{group}, {name}"] = Count(value)
    return found


def _groups(trial: Trial) -> Iterator[tuple[str, list[Pixels], list[Pixels]]]:
    """Yield the name of a group, our pictures and theirs."""
    real = trial.real
    if real.photos:
        yield (
            "photographs",
            [view.image for view in trial.renders.views("seafront")],
            list(real.photos),
        )
        gate = trial.renders.views("gate")
        yield "photographs, preset gate", [view.image for view in gate], list(real.photos)
    if real.panels:
        pairs = trial.renders.held_out.panels
        # one panel of each pair, which differ too little to count as two
        ours = [p.undamaged if k % 2 else p.damaged for k, p in enumerate(pairs)]
        theirs = _both(real.panels)
        yield "panels", ours, theirs
    if real.identifiers:
        ours = [text.framed() for text in trial.renders.texts]
        yield "identifiers", ours, [r.pixels for r in real.identifiers]


SECTIONS: Mapping[str, Callable[[Trial], Measures]] = {
    "markers": markers,
    "identifiers": identifiers,
    "false": false_markers,
    "damage": damage,
    "containers": containers,
    "statistics": image_statistics,
}
"""Sections that are measured with each seed, by their name on the command line."""


def _top1(
    model: Classifier, crops: Sequence[Pixels] | NDArray[np.uint8], names: Sequence[str]
) -> tuple[Share, list[str]]:
    """Return the share of right classes and the guesses. A guess is never the background."""
    shares: Array = model.shares(np.asarray(crops))[:, :_BACKGROUND].astype(float)
    guessed = [MARKER_CLASSES[k] for k in shares.argmax(axis=1)]
    right = sum(a == b for a, b in zip(guessed, names, strict=True))
    return Share(right, len(names)), guessed
