"""Labelled crops from fresh renders: markers, identifiers, panels and backgrounds.

A gate camera stands a few metres from the container. Cameras here are therefore aimed at single
markers and identifiers from there, in small images. panel_crops.py does so for damages. The second
view of a scene costs a fifth of the first, so each scene gives many crops.
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np
from aimed_cameras import aimed, place_mm
from numpy.typing import NDArray
from panel_crops import HANGING, STANDING, Pixels, panels_of, square_crop
from real_crops import PanelPair

from fastgen import Config, Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.decals.glyphs import BOX
from fastgen.decals.lettering import TILE_BASELINE_CAPS
from fastgen.geometry.damage_law import deform
from fastgen.geometry.shape_library import SHAPES
from fastgen.labels.objects import labelled_decals
from fastgen.sample import Object, Sample
from fastgen.sampling.streams import stream
from fastgen.scene import Camera, Decal, Scene

MARKER_PX = 48
"""Side of the crops of markers and backgrounds."""

CODE_LENGTH = 11
"""Characters of an identifier: owner code, serial number, check digit."""

KINDS = ("markers", "texts", "panels")

_LETTERED = Config.from_values(
    {
        "markings": {"markers_per_face": [2, 10]},
        "sensor": {
            "motion": {"probability": 0.2, "extent": [0.001, 0.006]},
            "exposure_error_ev": [-0.7, 0.7],
            "white_balance_ev": [-0.15, 0.15],
            "noise": {"probability": 0.8},
            "jpeg_quality": [50, 95],
        },
    }
)
"""More markers than the preset, and the sensor effects of the preset `crane` that are not part of a
scene's surroundings."""

TRAINING = {"markers": [_LETTERED], "texts": [_LETTERED], "panels": [HANGING, STANDING]}
"""Distributions of the scenes by the kind of crop, each for an equal share of the scenes."""

_FACES = ("front", "back", "door", "no_door")
_VIEW_PX = 352
_TEXT_MARGIN_CAPS = 0.7
_SEEN = 0.9
_LEAST_CAP_PX = 9.0


@dataclass(frozen=True, eq=False)
class Text:
    """Crop of an identifier.

    Attributes:
        pixels: RGB picture [H, W, 3] with a margin around the letters.
        code: Owner code, serial number and check digit.
        layout: 'rows', 'block' or 'column'.
        on_end: True on an end of the container, False on a long side.
        letters_px: Centres of the letters of `code`, float64 [11, 2], x right and y down.
        frame_px: Box of all letters x0, y0, x1, y1.
        cap_px: Height of the capitals.
    """

    pixels: Pixels
    code: str
    layout: str
    on_end: bool
    letters_px: NDArray[np.float64]
    frame_px: tuple[float, float, float, float]
    cap_px: float

    def framed(self) -> Pixels:
        """Return the box of the letters with the margin of the real crops, a third of a capital."""
        height, width = self.pixels.shape[:2]
        x0, y0, x1, y1 = self.frame_px
        rim = self.cap_px / 3
        left, top = max(int(x0 - rim), 0), max(int(y0 - rim), 0)
        return self.pixels[top : min(int(y1 + rim), height), left : min(int(x1 + rim), width)]


@dataclass(eq=False)
class Crops:
    """Crops of many scenes.

    Attributes:
        markers: Crops [MARKER_PX, MARKER_PX, 3] and their classes.
        backgrounds: Crops of the same size without a marker.
        texts: Identifiers.
        panels: Pairs of crops [PANEL_PX, PANEL_PX, 3] with the damage class.
    """

    markers: list[tuple[Pixels, str]] = field(default_factory=list)
    backgrounds: list[Pixels] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)
    panels: list[PanelPair] = field(default_factory=list)

    def add(self, other: "Crops") -> None:
        """Append the crops of another set."""
        for name, mine in vars(self).items():
            mine += getattr(other, name)


def training_crops(seed: int, scenes: range, wanted: Sequence[str], workers: int) -> Crops:
    """Render scenes and cut out crops.

    Args:
        seed: Seed of the scenes.
        scenes: Indices of the scenes.
        wanted: Kinds of crops to render, from KINDS.
        workers: Processes that render.
    """
    share = partial(_crops_of, seed, tuple(wanted))
    shares = [scenes[i :: 4 * workers] for i in range(4 * workers)]
    shares = [each for each in shares if len(each)]
    made = Crops()
    for crops in in_processes(share, shares, workers):
        made.add(crops)
    return made


def in_processes(task: Any, arguments: Sequence[Any], workers: int) -> Iterator[Any]:
    """Yield the task's result for each argument, computed by `workers` processes in order."""
    os.environ.setdefault("LP_NUM_THREADS", "0")  # inherited: one thread per process
    if workers == 1:
        yield from map(task, arguments)
        return
    # a process with OpenGL or torch must not be forked
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(task, arguments)


def _crops_of(seed: int, wanted: tuple[str, ...], scenes: Iterable[int]) -> Crops:
    made = Crops()
    scenes = list(scenes)
    for kind in wanted:
        configs = TRAINING[kind]
        for part, config in enumerate(configs):
            own = [index for index in scenes if index % len(configs) == part]
            if not own:
                continue
            with Generator(config, seed, (_VIEW_PX, _VIEW_PX)) as generator:
                for index in own:
                    _add_crops(made, kind, generator, index)
    return made


def _add_crops(made: Crops, kind: str, generator: Generator, index: int) -> None:
    """Append the crops of one scene."""
    scene = generator.scene(index)
    rng = stream(generator.seed, index, f"gap.{kind}")
    if kind == "panels":
        made.panels += panels_of(generator, scene, rng)
        return
    for camera in _cameras(scene, kind, rng):
        sample = generator.render(scene=scene, camera=camera)
        if kind == "texts":
            made.texts += texts_of(sample)
        else:
            pairs = marker_objects(sample)
            made.markers += [
                (square_crop(sample.image, box, MARKER_PX), name) for name, box in pairs
            ]
            made.backgrounds += _backgrounds_of(sample, rng)


def _cameras(scene: Scene, kind: str, rng: np.random.Generator) -> Iterator[Camera]:
    """Yield cameras that are aimed at the scene's markers or identifiers."""
    for face in _FACES:
        if kind == "texts":
            for decal in scene.decals:
                if decal.class_name == "text" and decal.face == face:
                    size = max(decal.size_mm) * float(rng.uniform(1.15, 1.5))
                    yield aimed(scene, face, place_mm(scene, decal), size, rng)
            continue
        markers = [d for d in scene.decals if d.kind == "marker" and d.face == face]
        if markers:
            decal = markers[int(rng.integers(len(markers)))]
            size = float(np.exp(rng.uniform(np.log(900), np.log(3500))))
            yield aimed(scene, face, place_mm(scene, decal), size, rng)


def marker_objects(sample: Sample) -> list[tuple[str, tuple[float, float, float, float]]]:
    """Return class and box of each marker that is inside the image and hardly occluded."""
    return [
        (item.class_name, item.amodal_bbox)
        for item in sample.objects
        if item.class_name in MARKER_CLASSES
        and not item.truncated
        and item.visible_fraction >= _SEEN
        and item.amodal_bbox is not None
        and min(_sides(item.amodal_bbox)) >= MARKER_PX / 2
    ]


def _backgrounds_of(sample: Sample, rng: np.random.Generator, count: int = 3) -> list[Pixels]:
    """Return random squares that overlap no marker."""
    height, width = sample.view.size[1], sample.view.size[0]
    boxes = np.array(
        [i.bbox for i in sample.objects if i.class_name in MARKER_CLASSES and i.bbox], float
    ).reshape(-1, 4)
    found = []
    for _ in range(count):
        side = float(np.exp(rng.uniform(np.log(24), np.log(160))))
        x, y = rng.uniform(0, width - side), rng.uniform(0, height - side)
        apart = (
            (boxes[:, 0] >= x + side)
            | (boxes[:, 2] <= x)
            | (boxes[:, 1] >= y + side)
            | (boxes[:, 3] <= y)
        )
        if apart.all():
            box = (x, y, x + side, y + side)
            found.append(square_crop(sample.image, box, MARKER_PX, margin=0.0))
    return found


def texts_of(sample: Sample) -> list[Text]:
    """Return the identifiers of an image that are inside it and hardly occluded."""
    found = []
    for item in sample.objects:
        if item.class_name != "text" or item.truncated or item.visible_fraction < _SEEN:
            continue
        decal = labelled_decals(sample.scene)[item.id]
        if item.quad and decal.cap_mm * _px_per_mm(item, decal) >= _LEAST_CAP_PX:
            found.append(_text(sample, item, decal))
    return found


def _text(sample: Sample, item: Object, decal: Decal) -> Text:
    first = _letters_px(sample, decal)[:CODE_LENGTH]
    cap = decal.cap_mm * _px_per_mm(item, decal)
    box = np.array(item.quad).reshape(4, 2)
    low, high = box.min(axis=0), box.max(axis=0)
    margin = _TEXT_MARGIN_CAPS * cap
    width, height = sample.view.size
    x0, y0 = np.maximum(np.floor(low - margin), 0).astype(int).tolist()
    x1, y1 = np.minimum(np.ceil(high + margin), (width, height)).astype(int).tolist()
    corner = np.array([x0, y0])
    (left, top), (right, bottom) = (low - corner).tolist(), (high - corner).tolist()
    return Text(
        sample.image[y0:y1, x0:x1].copy(),
        item.text.replace(" ", "")[:CODE_LENGTH],
        _layout(first),
        decal.face in ("door", "no_door"),
        first - corner,
        (left, top, right, bottom),
        cap,
    )


def _letters_px(sample: Sample, decal: Decal) -> NDArray[np.float64]:
    """Return the centres of a text's letters in reading order, float64 [N, 2] in pixels."""
    lettering = decal.lettering
    middle = np.array(lettering.size_mm) / 2
    centers = np.array(
        [
            ((g.x0 + g.x1) / 2, g.y0 + (TILE_BASELINE_CAPS + 0.5) * decal.cap_mm)
            for g in lettering.glyphs
            if g.char != BOX
        ]
    )
    sheet = (centers - middle) @ decal.turn.T + np.array(decal.center_mm)
    container = sample.scene.container
    mesh = SHAPES.container(container.kind, container.profiles)
    rest, _ = mesh.sheet_to_surface(decal.face, sheet)
    return sample.view.project(deform(sample.scene.damages, rest))[0]


def _px_per_mm(item: Object, decal: Decal) -> float:
    """Return the smaller scale of a decal, along its lower or its left edge."""
    upper_left, _, lower_right, lower_left = np.array(item.quad).reshape(4, 2)
    across = np.linalg.norm(lower_right - lower_left) / decal.size_mm[0]
    up = np.linalg.norm(upper_left - lower_left) / decal.size_mm[1]
    return float(min(across, up))


def _layout(letters_px: NDArray[np.float64]) -> str:
    """Return the layout of a code from the centres of its letters."""
    across, down = np.abs(letters_px[2] - letters_px[0])
    if down > across:
        return "column"
    drop, advance = letters_px[-1, 1] - letters_px[0, 1], letters_px[2, 0] - letters_px[0, 0]
    return "rows" if abs(drop) < abs(advance) * 0.8 else "block"


def _sides(box: Sequence[float]) -> tuple[float, float]:
    return box[2] - box[0], box[3] - box[1]
