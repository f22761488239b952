"""Meshes that are built once and then read from the disk cache."""

import json
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import Chart, Mesh, Zone

_ARRAYS = ("positions_mm", "normals", "atlas_mm", "zone", "triangles")


def stored(name: str, inputs: object, build: Callable[[], Mesh]) -> Mesh:
    """What `build` gives for `inputs`, its arrays read-only; see disk_cache.computed."""
    arrays = disk_cache.computed(name, inputs, lambda: _packed(build()))
    about = json.loads(arrays["about"].tobytes())
    return Mesh(
        **{key: arrays[key] for key in _ARRAYS},
        charts=tuple(
            Chart(part, face, material, (x, y, width, height))
            for part, face, material, (x, y, width, height) in about["charts"]
        ),
        zones=tuple(
            Zone(chart, (x, y, width, height), turns, small, level)
            for chart, (x, y, width, height), turns, small, level in about["zones"]
        ),
        atlas_size_mm=(about["atlas_size_mm"][0], about["atlas_size_mm"][1]),
        groups={group: slice(*ends) for group, ends in about["groups"].items()},
        flats={
            face: tuple((start, end) for start, end in flats)
            for face, flats in about["flats"].items()
        },
    )


def _packed(mesh: Mesh) -> dict[str, NDArray[np.generic]]:
    about = {
        "charts": [(c.name, c.face, c.material, c.rect_mm) for c in mesh.charts],
        "zones": [(z.chart, z.rect_mm, z.quarter_turns, z.small, z.level) for z in mesh.zones],
        "atlas_size_mm": mesh.atlas_size_mm,
        "groups": {name: (part.start, part.stop) for name, part in mesh.groups.items()},
        "flats": dict(mesh.flats),
    }
    return {
        **{key: getattr(mesh, key) for key in _ARRAYS},
        "about": np.frombuffer(json.dumps(about).encode(), np.uint8),
    }
