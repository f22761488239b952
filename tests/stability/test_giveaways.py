"""The renderer's choices do not depend on what is labelled.

A network that is trained on images whose shading rate, filter or mesh changes near a label learns
the renderer instead of the object. The first test therefore draws damages that change nothing,
without depth, hole or scar. They must leave the image as it is.
"""

import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    CONTAINER_ID,
    MARKER_CLASSES,
    UNDAMAGED_CONTAINER,
)
from fastgen.damages.buckled import BUCKLED
from fastgen.damages.creased import CREASED
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render import draw_blocks as rendering
from fastgen.render.draw_inputs import regions_of
from fastgen.scene.damage_kinds import forms_of

SIZE = (320, 240)
DAMAGED = {"damage": {"probability": 1, "count": [12, 14], "kinds": list(ALL_DAMAGE_CLASSES)}}


def without_effect(damage_values):
    """Wrap `damage_values` so that all damages are drawn, but displace, tear and scar nothing."""

    def null(*args):
        values = dict(damage_values(*args))
        values["damage_inward"] = [(*row[:3], 0.0) for row in values["damage_inward"]]
        values["damage_bare"] = [(*row[:3], 0.0) for row in values["damage_bare"]]
        shape = np.array(values["damage_shape"]).reshape(-1, 12)
        for form, flattens in ((CREASED, 7), (BUCKLED, 6)):  # share of the corrugation
            number = forms_of(args[2]).index(form)
            drawn = slice(values[f"form_{number - 1}_end"], values[f"form_{number}_end"])
            shape[drawn, flattens] = 0.0
        values["damage_shape"] = shape.reshape(-1, 4)
        holes = values["hole_count"]
        for name in ("damage_along", "damage_across"):
            values[name] = [
                (*row[:3], 1e-3 if i < holes else row[3]) for i, row in enumerate(values[name])
            ]
        return values

    return null


@pytest.mark.parametrize(
    "quality", ["draft", "balanced", "fine"]
)  # rays of `high` see true damages
def test_damages_without_effect_leave_the_image_as_it_is(quality, monkeypatch):
    config = Config.from_values(DAMAGED)
    monkeypatch.setattr(rendering, "damage_values", without_effect(rendering.damage_values))
    kinds = set()
    with Generator(config, seed=2, size=SIZE, quality=quality) as generator:
        for index in range(3):
            scene = generator.scene(index)
            kinds |= {(d.kind, d.form) for d in scene.damages}
            bare = replace(scene, damages=())
            for camera in ("A", "Cr"):
                damaged = generator.render(scene=scene, camera=camera)
                plain = generator.render(scene=bare, camera=camera)
                changed = (damaged.image != plain.image).any(axis=2)
                # programs with and without damage may round the position of an edge differently
                assert changed.sum() <= 2e-4 * changed.size, changed.sum()
    assert len(kinds) >= 5


@pytest.mark.parametrize("quality", ["draft", "balanced", "fine"])
def test_decals_change_no_pixel_beside_their_ink(quality):
    config = Config.from_values({"damage": {"probability": 0}})
    touched = 0
    with Generator(config, seed=2, size=SIZE, quality=quality) as generator:
        for index in range(3):
            scene = generator.scene(index)
            rest = tuple(d for d in scene.decals if not d.class_name)
            unlabelled = replace(scene, decals=rest)
            for camera in ("A", "B", "Cr"):
                printed = generator.render(scene=scene, camera=camera)
                plain = generator.render(scene=unlabelled, camera=camera)
                changed = (printed.image != plain.image).any(axis=2)
                # outlines, because a visible tip of a decal may hold no pixel centre and so no id
                outlines = [item.polygon for item in printed.objects if item.quad and item.polygon]
                corners = [np.rint(np.reshape(o, (-1, 2)) - 0.5).astype(int) for o in outlines]
                ink = cv2.fillPoly((printed.ids != plain.ids).astype(np.uint8), corners, 1)
                around = cv2.dilate(ink, np.ones((5, 5), np.uint8)) > 0
                assert (changed & ~around).sum() <= 1e-4 * changed.size
                touched += int(changed.sum())
    assert touched > 1000


def quads(values, shift):
    """Return the 2x2 blocks of `values` [H, W, ...] from a first row and column, [N, 4, ...]."""
    height, width = ((side - shift) // 2 * 2 for side in values.shape[:2])
    part = values[shift : shift + height, shift : shift + width]
    four = [part[y::2, x::2] for y in (0, 1) for x in (0, 1)]
    return np.stack(four, axis=2).reshape(-1, 4, *values.shape[2:])


def detectors(image):
    """Return traces of rendering in quads [N, 4, 3] by name, float [N]."""
    values = image.astype(float)
    signs = np.array([1.0, -1.0, -1.0, 1.0])[:, None]
    return {
        "flat": (np.ptp(values, axis=1) == 0).all(axis=1).astype(float),
        "noise": values.std(axis=1).mean(axis=1),
        "pattern": np.abs((values * signs).sum(axis=1)).mean(axis=1),
    }


def separation(scores, marked):
    """Return how far the AUC of `scores` is from chance: |P(a > b) + P(a = b) / 2 - 1/2|."""
    values, place = np.unique(scores, return_inverse=True)
    ours, theirs = (np.bincount(place[m], minlength=len(values)) for m in (marked, ~marked))
    below = np.cumsum(theirs) - theirs
    wins = (ours * (below + 0.5 * theirs)).sum()
    return abs(wins / (ours.sum() * theirs.sum()) - 0.5)


def classes_of(sample):
    """Return the class of each pixel [H, W]: a damage class, plain, text, marker or other."""
    names = np.full(sample.ids.shape, "other", object)
    names[(sample.ids == CONTAINER_ID) & (sample.damage == UNDAMAGED_CONTAINER)] = "plain"
    for value, name in enumerate(ALL_DAMAGE_CLASSES, start=2):
        names[(sample.ids == CONTAINER_ID) & (sample.damage // 100 == value)] = name
    for item in sample.objects:
        if item.class_name == "text" or item.class_name in MARKER_CLASSES:
            kind = "text" if item.class_name == "text" else "marker"
            names[sample.ids == item.id] = kind
    return names


@pytest.mark.parametrize("quality", ["draft", "balanced", "fine"])
def test_traces_of_rendering_tell_labels_no_better_on_the_pixel_grid_than_beside_it(quality):
    """Blocks that are shaded at once begin at even pixels; shifted quads have no part in them."""
    config = Config.from_values(DAMAGED)
    names, scores = {0: [], 1: []}, {0: [], 1: []}
    with Generator(config, seed=5, size=(400, 400), quality=quality) as generator:
        for index, camera in itertools.product(range(6), ("A", "B", "Cl", "Cr")):
            sample = generator.render(index, camera=camera)
            classes = classes_of(sample)
            for shift in (0, 1):
                inside = quads(classes, shift)
                uniform = (inside == inside[:, :1]).all(axis=1)
                names[shift].append(inside[uniform, 0])
                found = detectors(quads(sample.image, shift)[uniform])
                scores[shift].append(np.stack(list(found.values())))
    for name in (*ALL_DAMAGE_CLASSES, "marker", "text"):
        apart = []
        for shift in (0, 1):
            of_quads = np.concatenate(names[shift])
            chosen = (of_quads == name) | (of_quads == "plain")
            marked = of_quads[chosen] == name
            assert marked.sum() > 20, name
            every = np.concatenate(scores[shift], axis=1)[:, chosen]
            apart.append(np.array([separation(each, marked) for each in every]))
        # quads of one object resemble each other, so AUCs differ by chance by a few hundredths
        assert (apart[0] < apart[1] + 0.1).all(), (name, apart)


def test_damage_does_not_change_where_cables_get_more_samples():
    """`draft` draws regions above containers with more samples, and damage may reach into them."""
    config = Config.from_values(DAMAGED)
    compared = 0
    with Generator(config, seed=2, size=SIZE, quality="draft") as generator:
        for index, name in itertools.product(range(6), ("A", "B", "Cl", "Cr")):
            scene = generator.scene(index)
            view = view_of(scene.camera(name), SIZE)
            damaged, plain = (
                regions_of(view, PreparedScene(each), each.damages, apart=True).cables
                for each in (scene, replace(scene, damages=()))
            )
            assert damaged == plain, (index, name)
            compared += len(plain)
    assert compared > 5
