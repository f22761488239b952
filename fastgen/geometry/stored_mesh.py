"""Meshes as entries of the disk cache."""

import json
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import Chart, Mesh, Zone

_LAYOUT = {
    "positions_mm": "float32 V 3",
    "normals": "float32 V 3",
    "atlas_mm": "float32 V 2",
    "zone": "unsigned V",
    "triangles": "uint32 T 3",
    "about": "uint8 N",
}

_ARRAYS = tuple(name for name in _LAYOUT if name != "about")
"""Arrays that are fields of a Mesh; `about` holds its other fields."""


def stored(name: str, version: int, inputs: object, build: Callable[[], Mesh]) -> Mesh:
    """Return a mesh with read-only arrays from the disk cache, and build it if it is not there.

    Args:
        name: Name of the producer.
        version: Version of the producer.
        inputs: Everything else that the mesh depends on.
        build: Returns the mesh.
    """
    arrays = disk_cache.cached(name, version, inputs, lambda: _packed(build()), layout=_LAYOUT)
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
