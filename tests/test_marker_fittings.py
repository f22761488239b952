"""Holders, rivets and orange panels of markers, and traces of removed markers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fastgen.classes import MARKER_CLASSES
from fastgen.config.config import Config
from fastgen.decals.artwork import un_numbers
from fastgen.errors import ConfigError
from fastgen.generator import Generator

FITTINGS = ("marker_holder", "marker_rivets", "un_panel", "un_panel_small")
NONE = {
    "marker_holder": 0,
    "marker_rivets": 0,
    "marker_un_panel": 0,
    "removed_markers": [0, 0],
}
FACES = ("front", "back", "door", "no_door")


def scenes(count=12, **markings):
    generator = Generator(Config.from_values({"markings": {**NONE, **markings}}), seed=21)
    return [generator.scene(i) for i in range(count)]


def of(scene, face, *art):
    return [d for d in scene.decals if d.face == face and d.art in art]


def markers(scene, face):
    return [d for d in scene.decals if d.face == face and d.class_name in MARKER_CLASSES]


def test_fittings_change_no_labelled_decal():
    plain = scenes()
    every = scenes(
        marker_holder=1,
        marker_rivets=1,
        marker_un_panel=1,
        removed_markers=[2, 2],
        marker_torn=0.12,
    )
    for a, b in zip(plain, every, strict=True):
        assert [d for d in a.decals if d.class_name] == [d for d in b.decals if d.class_name]
        assert not [d for d in a.decals if d.art in FITTINGS]


def test_holders_lie_below_their_markers_and_reach_no_other_marker():
    count = 0
    for scene in scenes(marker_holder=1, marker_gap_mm=[20, 40]):
        for face in FACES:
            held = of(scene, face, "marker_holder")
            found = markers(scene, face)
            count += len(held)
            assert len(held) in (0, len(found))
            for holder, marker in zip(held, found, strict=False):
                assert not holder.class_name
                assert (holder.center_mm, holder.rotation_deg) == (
                    marker.center_mm,
                    marker.rotation_deg,
                )
                assert holder.size_mm[0] > marker.size_mm[0] + 15
                assert scene.decals.index(holder) < scene.decals.index(marker)
                for other in found:
                    if other is not marker:
                        offset = np.abs(np.subtract(other.center_mm, holder.center_mm)).sum()
                        reach = (holder.size_mm[0] + other.size_mm[0]) / 2
                        turned = max(abs(d.rotation_deg) for d in found)
                        assert offset > reach * math.cos(math.radians(turned)) - 1
    assert count > 30


def test_rivets_lie_on_markers_and_leave_their_labels_alone(generators):
    (scene, *_) = scenes(1, marker_rivets=1)
    rivets = [d for d in scene.decals if d.art == "marker_rivets"]
    assert len(rivets) == sum(len(markers(scene, face)) for face in FACES)
    bare = replace(scene, decals=tuple(d for d in scene.decals if d.art != "marker_rivets"))
    generator = generators(size=(320, 240), quality="draft")
    for camera in ("A", "B"):
        a, b = (generator.render(scene=s, camera=camera) for s in (scene, bare))
        assert a.objects == b.objects


def test_a_panel_shows_a_number_of_a_class_on_its_face():
    count = 0
    for scene in scenes(marker_un_panel=1):
        for face in FACES:
            for panel in of(scene, face, "un_panel", "un_panel_small"):
                low = np.subtract(panel.center_mm, np.array(panel.size_mm) / 2)
                high = np.add(panel.center_mm, np.array(panel.size_mm) / 2)
                rows = [
                    d
                    for d in scene.decals
                    if d.kind == "text"
                    and d.face == face
                    and (low < d.center_mm).all()
                    and (d.center_mm < high).all()
                ]
                numbers = {m.class_name: un_numbers()[m.class_name] for m in markers(scene, face)}
                number = rows[-1].text
                hazard = rows[0].text if len(rows) > 1 else None
                matching = [n for n, (_, un) in numbers.items() if number in un]
                assert matching
                assert hazard is None or any(numbers[n][0] == hazard for n in matching)
                for row in rows:
                    half = np.array(row.size_mm) / 2
                    assert (np.subtract(row.center_mm, half) > low).all()
                    assert (np.add(row.center_mm, half) < high).all()
                    assert row.cap_mm >= 65  # IMDG Code 5.3.2.1.1
                count += 1
    assert count > 20


def test_removed_markers_have_the_configured_number_and_are_darker_than_the_paint():
    for scene in scenes(removed_markers=[1, 2], stickers_per_face=[0, 0]):
        paint = np.array(scene.surface.paint.albedo)
        for face in FACES:
            found = of(scene, face, "overpaint_1", "overpaint_2", "placard_residue")
            assert len(found) <= 2
            for trace in found:
                assert not trace.class_name
                if trace.kind == "emblem":
                    assert (np.array(trace.albedo) <= 0.8 * paint + 1e-6).all()


def test_every_removed_marker_finds_its_place_on_an_empty_wall():
    counts = [
        len(of(scene, "front", "overpaint_1", "overpaint_2", "placard_residue"))
        for scene in scenes(
            removed_markers=[2, 2], stickers_per_face=[0, 0], markers_per_face=[0, 0]
        )
    ]
    assert np.mean(counts) > 1.8


def test_fittings_without_markers_are_absent():
    for scene in scenes(4, marker_holder=1, marker_un_panel=1, markers_per_face=[0, 0]):
        assert not [d for d in scene.decals if d.art in FITTINGS]


@pytest.mark.parametrize("name", ["marker_holder", "marker_rivets", "marker_un_panel"])
def test_probabilities_above_one_are_refused(name):
    with pytest.raises(ConfigError, match=f"markings.{name}"):
        Config.from_values({"markings": {name: 1.5}})
