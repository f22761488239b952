"""Shard makers for runs on Ray, in a module that an actor imports quickly."""

import os
import time

import ray

from tests.crash_run import FAULTY_SCENE, QuickMaker

HANGING_SCENE = 14
HANG_S = 1.5


class SlowMaker(QuickMaker):
    """Maker slow enough to end the run or a node in mid-run."""

    def __call__(self, task):
        time.sleep(0.25)
        super().__call__(task)


class LocatedMaker(SlowMaker):
    """Maker that reports the node and process of each shard."""

    def __call__(self, task):
        self._report("made on", (ray.get_runtime_context().get_node_id(), os.getpid()))
        super().__call__(task)


class FaultyMaker(QuickMaker):
    def _image(self, index, camera):
        if index == FAULTY_SCENE:
            os.abort()
        if index == HANGING_SCENE:
            time.sleep(3600)
        return super()._image(index, camera)


class PreparingMaker(QuickMaker):
    """Maker that needs four times HANG_S before its first shard, and reports that it is busy."""

    _prepared = False

    def __call__(self, task):
        for _ in range(0 if self._prepared else 16):
            time.sleep(HANG_S / 4)
            self._report("busy", None)
        self._prepared = True
        super().__call__(task)


class BrokenMaker(QuickMaker):
    def _image(self, index, camera):
        raise OSError(28, "No space left on device")
