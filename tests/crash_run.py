"""Dataset run whose workers quickly write made-up bytes; test_storage.py kills it.

    python tests/crash_run.py OUT SCENES WORKERS

The environment variable FAULT makes scene 5 fail each time it is rendered: 'crash' aborts its
worker, 'hang' makes the worker sleep.
"""

import os
import random
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
import simplejpeg

from fastgen.config.config import Config
from fastgen.dataset.generate import generate, run_here
from fastgen.dataset.job import Job
from fastgen.dataset.shards import Maker
from fastgen.dataset.storage import storage_of
from fastgen.render.settings import RenderSettings
from fastgen.sampling.scene import split_of

FAULTY_SCENE = 5


class QuickMaker(Maker):
    """Shard maker that renders nothing: its bytes depend only on the scene index."""

    fault = ""

    def __init__(self, job, whole_machine, report):
        self._job, self._report, self._formats = job, report, ()
        self._storage = storage_of(job.out)
        self._made_by = {"backend": "none", "renderer": "none"}

    def _image(self, index, camera):
        if index == FAULTY_SCENE and os.environ.get("FAULT") == "crash":
            os.abort()
        if index == FAULTY_SCENE and os.environ.get("FAULT") == "hang":
            time.sleep(3600)
        time.sleep(0.004)
        split, stem = (
            split_of(self._job.config, self._job.seed, index),
            self._job.stem(index, camera),
        )
        pixels = np.full((64, 64, 3), index % 256, np.uint8)
        files = {
            f"images/{split}/{stem}.jpg": simplejpeg.encode_jpeg(pixels),
            f"imdg/labels/{split}/{stem}.txt": b"",
            f"damage/yolo/{split}/{stem}.txt": b"",
            f"scenes/{split}/{stem}.json": random.Random(index).randbytes(2000 + index),
        }
        facts = {"damage": [], "imdg": [], "container": [], "text": [], "door": None}
        record = {"stem": stem, "split": split, "size": [64, 64], "facts": facts}
        return files, record


def make(out, scenes, workers, hang_s=60.0, then=lambda: None):
    """Run the job and return the content of dataset.json. `then` is called after the last shard."""
    config = Config.preset()
    job = Job(str(out), scenes, config, 1, ("A",), RenderSettings((64, 64)), shard_scenes=2)
    run = run_here(workers, hang_s, QuickMaker)

    def runner(*arguments):
        run(*arguments)
        then()

    return generate(job, workers, runner)


if __name__ == "__main__":
    make(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
