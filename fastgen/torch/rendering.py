"""A Generator in each process and thread that asks for one."""

import os
import threading
from typing import Any

from torch.utils.data import get_worker_info

from fastgen.generator import Generator


class LocalGenerator:
    """Hands each process and each thread a Generator of its own, made at first use.

    settings: arguments of Generator. It may be pickled and may be inherited through a fork: a
    child leaves its parent's Generator alone and makes another. A thread's Generator lives until
    `close` in that thread or the end of the process.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings
        self._local = threading.local()
        Generator(**settings).scene(0)  # refuses bad values here rather than in a worker

    def get(self) -> Generator:
        """This process's and thread's Generator."""
        if getattr(self._local, "process", None) != os.getpid():
            worker = get_worker_info()
            if worker is not None and worker.num_workers >= len(os.sched_getaffinity(0)):
                # one process a core is faster than llvmpipe's threads
                os.environ.setdefault("LP_NUM_THREADS", "0")
            self._local.generator = Generator(**self._settings)
            self._local.process = os.getpid()
        generator: Generator = self._local.generator
        return generator

    def close(self) -> None:
        """Free what this process and thread opened; a later `get` opens it again."""
        if getattr(self._local, "process", None) == os.getpid():
            self._local.generator.close()

    def __getstate__(self) -> dict[str, Any]:
        return self._settings

    def __setstate__(self, settings: dict[str, Any]) -> None:
        self._settings = settings
        self._local = threading.local()
