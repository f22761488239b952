"""Post-processing of every sample by a function that a configuration names."""

import hashlib
import importlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from fastgen.classes import ALL_SEGMENTATION_CLASSES
from fastgen.errors import ConfigError, FastgenError, nearest, shown
from fastgen.sample import Sample

Postprocess = Callable[[Sample, np.random.Generator], Sample]
"""Takes a sample and a random generator of its own, and returns the changed sample."""

_CLASSES = (*ALL_SEGMENTATION_CLASSES, "spreader", "seal")
"""Classes of objects besides those of the marker task."""

_ARRAYS = ("image", "ids", "damage", "depth")
"""Arrays that keep their shape and type."""


@cache
def imported(name: str) -> Postprocess:
    """Return the function called `name`, as in 'package.module:function'.

    Raises:
        ConfigError: It cannot be imported.
    """
    module, _, attribute = name.partition(":")
    try:
        function: Postprocess = getattr(importlib.import_module(module), attribute)
    except Exception as error:  # the module may raise anything while it is imported
        raise ConfigError(
            f"postprocess: {name} cannot be imported ({error!r}); install its package, or put its "
            "folder into PYTHONPATH"
        ) from error
    if not callable(function):
        raise ConfigError(f"postprocess: {name} is no function of a sample and a random generator")
    return function


def source_hash(name: str) -> str:
    """Return the SHA-256 of the file that defines a function, which decides its samples."""
    path = inspect.getsourcefile(inspect.unwrap(imported(name)))
    return hashlib.sha256(Path(path).read_bytes() if path else b"").hexdigest()


def postprocessed(sample: Sample, name: str, rng: np.random.Generator) -> Sample:
    """Return what a function makes of a sample.

    Args:
        sample: The sample.
        name: Name of the function.
        rng: Random generator that depends on seed, scene and camera alone.

    Raises:
        FastgenError: The function fails, or returns something else than such a sample.
    """
    try:
        made = imported(name)(sample, rng)
    except Exception as error:
        raise FastgenError(f"postprocess: {name} raised {error!r}; mend it") from error
    if not isinstance(made, Sample):
        raise FastgenError(f"postprocess: {name} returned {made!r}; it has to return a Sample")
    for field in _ARRAYS:
        before, now = getattr(sample, field), np.asarray(getattr(made, field))
        if (now.shape, now.dtype) != (before.shape, before.dtype):
            raise FastgenError(
                f"postprocess: {name} returned {field} as {now.dtype} {list(now.shape)}; keep "
                f"{before.dtype} {list(before.shape)}"
            )
    _check_objects(sample, made, name)
    return made


def _check_objects(sample: Sample, made: Sample, name: str) -> None:
    """Raise FastgenError unless classes and boxes of the objects of `made` can be written."""
    known = {*sample.marker_classes, *_CLASSES, *(each.class_name for each in sample.objects)}
    width, height = sample.view.size
    for item in made.objects:
        if item.class_name not in known:
            raise FastgenError(
                f"postprocess: {name} returned an object of the class {shown(item.class_name)}"
                f"{nearest(item.class_name, known)}"
            )
        box = item.bbox or (0, 0, width, height)
        inside = len(box) == 4 and 0 <= box[0] < box[2] <= width and 0 <= box[1] < box[3] <= height
        if not inside:
            raise FastgenError(
                f"postprocess: {name} returned the box {item.bbox} of {item.class_name}; give x0 < "
                f"x1 and y0 < y1 within {width}x{height} pixels, or None"
            )
