"""Renders that all seeds of the comparison with real pictures share.

Rendering takes as long as training. So the scenes are rendered once, in GROUPS groups, and each
seed trains on all groups but one. Seeds then differ in a third of their scenes, in the weights they
start from, and in the order and variation of the crops. Held-out renders are the same for all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

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
    """

    scenes: int = 300
    held_out: int = 50
    images: int = 40
    mined: int = 40
    marker_steps: int = 700
    reader_steps: int = 900
    damage_steps: int = 1500


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
        self._group = cache(self._rendered_group)
        self.views = cache(self._rendered_views)

    def crops(self, seed: int) -> Crops:
        """Return the training crops of one seed."""
        found = Crops()
        for group in range(GROUPS):
            if group != seed % GROUPS:
                found.add(self._group(group))
        return found

    def _rendered_group(self, group: int) -> Crops:
        size = -(-self._effort.scenes // (GROUPS - 1))
        return self._crops(range(group * size, (group + 1) * size))

    @cached_property
    def held_out(self) -> Crops:
        """Crops of other scenes of the same kind."""
        return self._crops(range(HELD_OUT, HELD_OUT + self._effort.held_out))

    def _crops(self, scenes: range) -> Crops:
        return training_crops(self._seed, scenes, self._kinds, self._workers)

    @cached_property
    def texts(self) -> list[Text]:
        """Held-out identifiers as the preset's own cameras see them."""
        scenes = range(HELD_OUT, HELD_OUT + self._effort.held_out)
        return default_texts(self._seed, scenes, self._workers)

    def _rendered_views(self, preset: str) -> list[View]:
        """Return held-out images of a preset."""
        scenes = range(HELD_OUT, HELD_OUT + self._effort.images)
        return default_views(preset, self._seed, scenes, self._workers)

    @cached_property
    def mined(self) -> list[View]:
        """Images that background crops are mined from."""
        scenes = range(MINED, MINED + self._effort.mined)
        return default_views("seafront", self._seed, scenes, self._workers)
