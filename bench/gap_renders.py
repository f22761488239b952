"""Renders that all seeds of the comparison with real pictures share.

Rendering takes as long as training. So the scenes are rendered once, in GROUPS groups, and each
seed trains on all groups but one. Seeds then differ in a third of their scenes, in the weights they
start from, and in the order and variation of the crops. Held-out renders are the same for all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from real_crops import BoxedImage
from rendered_boxes import boxed_renders
from rendered_crops import Crops, Text, training_crops
from rendered_views import View, default_texts, default_views

HELD_OUT, MINED = 1_000_000, 500_000
"""First scene of the held-out renders, and of the images that background crops are mined from."""

GROUPS = 4
"""Groups of training scenes; a seed uses all but one."""


@dataclass(frozen=True)
class Effort:
    """Amount of rendering, and of training with one seed.

    Attributes:
        scenes: Training scenes of one seed.
        held_out: Held-out scenes.
        images: Whole images of a preset, for the search and for the statistics.
        mined: Images that background crops are mined from.
        marker_steps: Training steps of the marker classifier.
        reader_steps: Training steps of the reader.
        damage_steps: Training steps of the damage classifier.
        box_steps: Training steps of the detector of containers.
    """

    scenes: int = 300
    held_out: int = 50
    images: int = 40
    mined: int = 40
    marker_steps: int = 700
    reader_steps: int = 900
    damage_steps: int = 1500
    box_steps: int = 4000


class Renders:
    """Renders of all seeds, made when they are first needed.

    Args:
        seed: Seed of the scenes.
        effort: Amount of rendering.
        workers: Processes that render.
        kinds: Crops to render: some of rendered_crops.KINDS.
    """

    def __init__(self, seed: int, effort: Effort, workers: int, kinds: Sequence[str]) -> None:
        self._seed, self._effort, self._workers, self._kinds = seed, effort, workers, kinds
        self._crops = cache(self._rendered_crops)
        self._boxed = cache(self._rendered_boxes)
        self.views = cache(self._rendered_views)

    def crops(self, seed: int) -> Crops:
        """Return the training crops of one seed."""
        found = Crops()
        for scenes in self._training_scenes(seed):
            found.add(self._crops(scenes))
        return found

    @property
    def held_out(self) -> Crops:
        """Crops of other scenes of the same kind."""
        return self._crops(self._held_out_scenes)

    def boxed(self, seed: int) -> list[BoxedImage]:
        """Return the training images of one seed with boxes of containers."""
        return [image for scenes in self._training_scenes(seed) for image in self._boxed(scenes)]

    @property
    def held_out_boxed(self) -> list[BoxedImage]:
        """Images of other scenes with boxes of containers."""
        return self._boxed(self._held_out_scenes)

    def _training_scenes(self, seed: int) -> list[range]:
        size = -(-self._effort.scenes // (GROUPS - 1))
        groups = [range(group * size, (group + 1) * size) for group in range(GROUPS)]
        return [scenes for group, scenes in enumerate(groups) if group != seed % GROUPS]

    @property
    def _held_out_scenes(self) -> range:
        return range(HELD_OUT, HELD_OUT + self._effort.held_out)

    def _rendered_crops(self, scenes: range) -> Crops:
        return training_crops(self._seed, scenes, self._kinds, self._workers)

    def _rendered_boxes(self, scenes: range) -> list[BoxedImage]:
        return boxed_renders(self._seed, scenes, self._workers)

    @cached_property
    def texts(self) -> list[Text]:
        """Held-out identifiers as the preset's own cameras see them."""
        return default_texts(self._seed, self._held_out_scenes, self._workers)

    def _rendered_views(self, preset: str) -> list[View]:
        """Return held-out images of a preset."""
        scenes = range(HELD_OUT, HELD_OUT + self._effort.images)
        return default_views(preset, self._seed, scenes, self._workers)

    @cached_property
    def mined(self) -> list[View]:
        """Images that background crops are mined from."""
        scenes = range(MINED, MINED + self._effort.mined)
        return default_views("seafront", self._seed, scenes, self._workers)
