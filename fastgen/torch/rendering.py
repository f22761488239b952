"""One Generator for each process and thread of a dataset."""

import os
import threading
from typing import Any

from torch.utils.data import get_worker_info

from fastgen.config.config import Config
from fastgen.cpus import usable_cpus
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings


class LocalGenerator:
    """Gives each process and each thread its own Generator, made at first use.

    It can be pickled and inherited through a fork: a child does not touch its parent's Generator
    and makes another. A thread's Generator lives until `close` in that thread or the end of the
    process.

    Raises:
        ConfigError: A value is not valid.
    """

    def __init__(self, config: Config, seed: int, settings: RenderSettings) -> None:
        self._arguments = (config, seed, settings)
        self._local = threading.local()
        Generator.of(*self._arguments).scene(0)  # refuses bad values here, not in a worker

    def get(self) -> Generator:
        """Return the Generator of this process and thread."""
        if getattr(self._local, "process", None) != os.getpid():
            worker = get_worker_info()
            if worker is not None and worker.num_workers >= usable_cpus():
                # one process per core is faster than llvmpipe's threads
                os.environ.setdefault("LP_NUM_THREADS", "0")
            self._local.generator = Generator.of(*self._arguments)
            self._local.process = os.getpid()
        generator: Generator = self._local.generator
        return generator

    def close(self) -> None:
        """Free what this process and thread opened. A later `get` opens it again."""
        if getattr(self._local, "process", None) == os.getpid():
            self._local.generator.close()

    def __getstate__(self) -> dict[str, Any]:
        return {"_arguments": self._arguments}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _local=threading.local())
