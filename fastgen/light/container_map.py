"""Container maps: the container or other obstacle that a panorama shows in each direction.

A container map is a 16-bit grey PNG beside its panorama NAME.exr or NAME.hdr, called
NAME.containers.png. It covers the same sphere in the same orientation, at any resolution. Its
values 1 to 65534 number the containers. OTHER is any other obstacle, such as a column or a vehicle,
and 0 is ground, water and sky. The bundled ports have one each, which assets/build_panoramas.py
renders from the same model as the panorama.
"""

import hashlib
import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import AssetError
from fastgen.files import disk_cache
from fastgen.files.plain_file import read_plain
from fastgen.light.environment import to_map_frame
from fastgen.light.hdri import LARGEST_FILE, MAX_WIDTH, MIN_WIDTH
from fastgen.light.octahedral import resample_octahedral

VERSION = 3  # raise when the stored arrays change

OTHER = 65535
"""Value of obstacles that are no containers."""

OBSTACLES_SIZE = 512
"""Texels along a side of `ContainerMap.obstacles`, including the border."""

_OBSTACLE_SAMPLES = 4
"""Samples per texel and axis of `ContainerMap.obstacles`."""

_PNG_START = struct.Struct(">8s8xIIBB")
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY_16 = [16, 0]
"""Start of a PNG: signature, width, height, bits and color type (W3C, PNG, sections 5 and 11.2).
It is checked first, because a decoder allocates whatever size the file claims."""

POINTS = 64
"""Directions per container in ContainerMap.points."""

_LAYOUT = {
    "rows": "uint16 R W",
    "first_row": "int64 1",
    "points": f"float32 N {POINTS} 3",
    "obstacles": f"uint8 {OBSTACLES_SIZE} {OBSTACLES_SIZE}",
}
"""Layout of a ContainerMap in the disk cache."""


@dataclass(frozen=True, eq=False)
class ContainerMap:
    """Containers of one panorama by direction.

    Attributes:
        rows: uint16 [R, W], the rows of the map that show containers, with an empty row above and
            below.
        first_row: Row of the whole map that is the first of `rows`; -1 if that is above the map.
        points: float32 [count + 1, POINTS, 3], directions in the map's frame that are spread over
            each container, by its number.
        obstacles: uint8 [OBSTACLES_SIZE, OBSTACLES_SIZE], octahedral with a border as in
            octahedral.py: share of each texel, of 255, that shows a container or another obstacle.
    """

    rows: NDArray[np.uint16]
    first_row: int
    points: NDArray[np.float32]
    obstacles: NDArray[np.uint8]

    @property
    def count(self) -> int:
        """Largest number of a container."""
        return len(self.points) - 1

    @property
    def width(self) -> int:
        """Texels around the horizon; the whole map is half as high."""
        return int(self.rows.shape[1])

    def texels(
        self, directions: ArrayLike, yaw_deg: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the places of world directions in `rows`.

        Args:
            directions: [..., 3], of any length.
            yaw_deg: Rotation of the environment.

        Returns:
            Column and row float64 [...] in texels; a texel centre has whole numbers.
        """
        x, y, z = np.moveaxis(to_map_frame(directions, yaw_deg), -1, 0)
        per_radian = self.width / (2 * np.pi)
        column = (np.pi - np.arctan2(y, x)) * per_radian - 0.5
        row = np.arctan2(np.hypot(x, y), z) * per_radian - 0.5 - self.first_row
        return column, row


def container_map_path(hdri: Path) -> Path:
    """Return the path at which a panorama's container map is, if it has one."""
    return hdri.with_suffix(".containers.png")


@lru_cache(maxsize=64)
def load_container_map(hdri: Path) -> ContainerMap | None:
    """Return the container map beside a panorama, None if there is none, as for photographs.

    A map takes 6 MB. It is mapped from the disk cache, so processes share its memory.

    Raises:
        AssetError: The file is not a 16-bit grey PNG that is twice as wide as high.
    """
    path = container_map_path(hdri)
    try:
        data = read_plain(path, LARGEST_FILE)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None
    stored = disk_cache.cached(
        "container-map",
        VERSION,
        hashlib.sha256(data).hexdigest(),
        lambda: _decoded(data, path),
        layout=_LAYOUT,
        what=f"container map {path.name}",
    )
    return ContainerMap(
        stored["rows"], int(stored["first_row"][0]), stored["points"], stored["obstacles"]
    )


def _decoded(data: bytes, path: Path) -> disk_cache.Arrays:
    """Return the fields of a ContainerMap from the content of its file."""
    start = data[: _PNG_START.size].ljust(_PNG_START.size, b"\0")
    signature, width, height, *kind = _PNG_START.unpack(start)
    if signature != _PNG_SIGNATURE or kind != _GREY_16:
        raise AssetError(f"{path}: a container map must be a grey PNG of 16 bits")
    if width != 2 * height or not MIN_WIDTH <= width <= MAX_WIDTH:
        raise AssetError(
            f"{path}: {width}x{height} texels; a container map must be twice as wide as high, and "
            f"{MIN_WIDTH} to {MAX_WIDTH} wide"
        )
    numbers = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if numbers is None or numbers.shape != (height, width):
        raise AssetError(f"{path}: a damaged PNG")
    mask = np.repeat((numbers > 0)[..., None].astype(np.float32), 3, axis=-1)
    shares = resample_octahedral(mask, OBSTACLES_SIZE, _OBSTACLE_SAMPLES)[..., 0]
    numbers[numbers == OTHER] = 0
    used = np.flatnonzero(numbers.any(axis=1))
    first, limit = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)
    rows = np.zeros((limit - first + 2, width), np.uint16)
    rows[1:-1] = numbers[first:limit]
    return {
        "rows": rows,
        "first_row": np.array([first - 1], np.int64),
        "points": _points(rows, first - 1),
        "obstacles": np.rint(255 * shares).astype(np.uint8),
    }


def _points(rows: NDArray[np.uint16], first_row: int) -> NDArray[np.float32]:
    """Return ContainerMap.points: texel centres, evenly spaced in raster order."""
    texel = np.flatnonzero(rows)
    number = rows.ravel()[texel]
    counts = np.bincount(number, minlength=1)
    first = np.cumsum(counts) - counts
    shares = (np.arange(POINTS) + 0.5) / POINTS
    nth = first[:, None] + (shares * counts[:, None]).astype(np.int64)
    ordered = np.append(texel[np.argsort(number, kind="stable")], 0)  # numbers may be unused
    row, column = np.divmod(ordered[nth], rows.shape[1])
    angle = 2 * np.pi / rows.shape[1]
    theta, phi = (row + first_row + 0.5) * angle, np.pi - (column + 0.5) * angle
    across = np.sin(theta)
    ways = (across * np.cos(phi), across * np.sin(phi), np.cos(theta))
    return np.stack(ways, axis=-1).astype(np.float32)
