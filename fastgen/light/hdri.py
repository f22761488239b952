"""HDRI files: bundled and user-supplied environments, and their radiance as arrays."""

import contextlib
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from fastgen.errors import AssetError
from fastgen.files.native_messages import without_native_messages
from fastgen.files.plain_file import open_plain
from fastgen.light.exr_layout import check_layout
from fastgen.resources import asset_path
from fastgen.scene.limits import OVERCAST_LX

HALF_MAX = 65504.0
"""Largest finite value of IEEE 754 binary16, the format of the maps on a GPU."""

LARGEST_FILE = 4 << 30
"""Largest size of an HDRI file in bytes; float32 RGBA of MAX_WIDTH without compression has half."""

MIN_WIDTH, MAX_WIDTH = 256, 16384
"""Smallest and largest width of an HDRI in texels."""

PORT_WEIGHT = 2.5
"""Weight of bundled ports in the draw of environments; other outdoor environments have 1."""

_SPECIAL = frozenset(("interior", "gate", "aisle", "rail"))
"""Kinds of environments that only some cameras see."""

_ASPECT_TOLERANCE = 0.02
_MAX_RADIANCE = 1e9  # the disc of the sun has 1.6e9 cd/m2; more could overflow a float32 sum


def find_hdris(folder: str | Path) -> list[Path]:
    """Return the .hdr and .exr files directly in a folder, sorted by name.

    The case of the extension does not matter. Hidden files are ignored; macOS leaves such files on
    foreign disks.

    Raises:
        AssetError: The folder does not exist or has no such file, or a name is not valid UTF-8.
    """
    if not str(folder):  # Path would use the current folder
        raise AssetError("'': is not a folder; give one that contains .hdr or .exr files")
    folder = Path(folder)
    if not folder.is_dir():
        raise AssetError(f"{folder}: no such folder; give one that contains .hdr or .exr files")
    seen = (path for path in folder.iterdir() if not path.name.startswith("."))
    found = sorted(path for path in seen if path.suffix.lower() in (".hdr", ".exr"))
    if not found:
        raise AssetError(f"{folder}: no .hdr or .exr file in this folder")
    for path in found:
        try:
            str(path).encode()
        except UnicodeEncodeError:  # scene files contain the name, and decoders need the path
            raise AssetError(f"{path}: name is not valid UTF-8; rename it") from None
    return found


def hdris_by_name(folder: str | Path) -> dict[str, Path]:
    """Return the HDRIs of a folder by name, see `find_hdris`.

    The brightness and the time of day of bundled HDRIs are looked up by name.

    Raises:
        AssetError: Two file names differ only in their extension, or a file has the name of a
            bundled HDRI but cannot be read or has other content.
    """
    named: dict[str, Path] = {}
    bundled = bundled_hdris()
    for path in find_hdris(folder):
        same_name = bundled.get(path.stem)
        if same_name and content_hash(path) != content_hash(same_name):
            raise AssetError(
                f"{path}: has the name of a bundled HDRI but other content; rename the file, "
                "because brightness and time of day are looked up by name"
            )
        if path.stem in named:
            raise AssetError(
                f"{folder}: {named[path.stem].name} and {path.name} are both called "
                f"{path.stem!r} in scenes; rename one"
            )
        named[path.stem] = path
    return named


_HOURS = {"dawn": (5, 7), "sunset": (17, 20), "dusk": (18, 21), "night": (21, 28)}
_DAYTIME = (8, 17)
_KIND_LX = {
    "interior": 500.0,
    "night": 20.0,
    "dusk": 200.0,
    "sunset": 5e3,
    "overcast": OVERCAST_LX,
    "dawn": 2e3,
    "day": 5e4,
}
"""Illuminance of level ground by kind; the first that fits counts."""


def bundled_hdris() -> dict[str, Path]:
    """Return the file of every bundled environment, sorted by name.

    assets/hdri/SOURCES.md lists their sources and licences.
    """
    return {name: asset_path("hdri", entry["file"]) for name, entry in _index().items()}


def bundled_weights() -> dict[str, float]:
    """Return the weight of every bundled environment in the random draw, sorted by name.

    Interiors, and places of a port without cranes, have weight 0: they are used only if a
    configuration names them.
    """
    kinds = {name: entry["kind"] for name, entry in _index().items()}
    return {
        name: 0.0 if _SPECIAL & set(kind) else PORT_WEIGHT if "port" in kind else 1.0
        for name, kind in kinds.items()
    }


@lru_cache
def hours_of(name: str) -> tuple[int, int]:
    """Return the first and last hour of the day at which an environment looks plausible.

    Hours after midnight are above 24. Environments that are not bundled have (0, 24).
    """
    if name not in _index():
        return 0, 24
    kinds = _index()[name]["kind"]
    return next((hours for kind, hours in _HOURS.items() if kind in kinds), _DAYTIME)


@lru_cache
def kind_of(name: str) -> str:
    """Return the kind of light of a bundled environment, a key of `_KIND_LX`; "" for others."""
    kinds = _index()[name]["kind"] if name in _index() else ()
    return next((kind for kind in _KIND_LX if kind in kinds), "")


@lru_cache
def illuminance_of(name: str) -> float:
    """Return the estimated light on level ground under an environment's open sky, in lux.

    The index has an estimate for most bundled environments, see assets/hdri/SOURCES.md. Others have
    that of their kind, and environments that are not bundled OVERCAST_LX.
    """
    if name not in _index():
        return OVERCAST_LX
    entry = _index()[name]
    if "lux" in entry:
        return float(entry["lux"])
    return next((lux for kind, lux in _KIND_LX.items() if kind in entry["kind"]), OVERCAST_LX)


def _index() -> dict[str, dict[str, Any]]:
    index = json.loads(asset_path("hdri", "index.json").read_text(encoding="utf-8"))
    return dict(sorted(index.items()))


def content_hash(path: Path) -> str:
    """Return the SHA-256 of an HDRI file, or of its container map, in hexadecimal.

    Raises:
        AssetError: The file cannot be read, is not a regular file, or has more than LARGEST_FILE
            bytes.
    """
    with _opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[io.BufferedReader]:
    """Open a file for reading; a failure to open or read it raises AssetError."""
    try:
        with open_plain(path, LARGEST_FILE) as file:
            yield file
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None


def load_radiance(path: str | Path) -> NDArray[np.float32]:
    """Return the linear radiance of an equirectangular .exr or .hdr file.

    W must be 256 to 16384 and H within 2 % of W / 2. Alpha is dropped and grey becomes three equal
    channels. Negative values become 0, NaN the mean of its valid neighbours, and infinity HALF_MAX,
    because files use it for a sun too bright for half floats.

    Returns:
        float32 [H, W, 3], finite and 0 or more.

    Raises:
        AssetError: The file is not such an image; the message names the file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in (".exr", ".hdr"):
        raise AssetError(f"{path}: an HDRI must be an .exr or .hdr file")
    with _opened(path) as file:
        radiance = _read_exr(path, file) if kind == ".exr" else _read_hdr(path, file)
    return _sanitized(radiance)


def _check_size(path: Path, width: int, height: int) -> None:
    if not MIN_WIDTH <= width <= MAX_WIDTH:
        raise AssetError(
            f"{path}: {width} texels wide; an HDRI must be {MIN_WIDTH} to {MAX_WIDTH} wide"
        )
    if abs(2 * height - width) > _ASPECT_TOLERANCE * width:
        raise AssetError(f"{path}: {width}x{height} texels; an HDRI must be twice as wide as high")


def _read_exr(path: Path, file: BinaryIO) -> NDArray[np.float32]:
    try:
        width, height = check_layout(file)
    except ValueError as error:
        raise AssetError(f"{path}: not a readable OpenEXR file ({error})") from None
    _check_size(path, width, height)
    try:
        with without_native_messages():
            channels = OpenEXR.File(str(path), separate_channels=True).channels()
        planes = {name: channel.pixels for name, channel in channels.items()}
    except Exception as error:  # any error of the decoder means a bad file
        raise AssetError(f"{path}: damaged OpenEXR file ({error})") from None
    names = _color_channels(path, list(planes))
    radiance = np.empty((height, width, 3), np.float32)
    for c, name in enumerate(names):
        if planes[name].shape != (height, width):
            raise AssetError(f"{path}: channel {name} is subsampled; save it at full resolution")
        radiance[..., c] = planes[name]
    return radiance


def _color_channels(path: Path, names: list[str]) -> tuple[str, str, str]:
    for red in sorted((n for n in names if n.split(".")[-1].upper() in ("R", "RED")), key=len):
        prefix = red.rpartition(".")[0]
        layer = {n.split(".")[-1].upper(): n for n in names if n.rpartition(".")[0] == prefix}
        for colors in (("R", "G", "B"), ("RED", "GREEN", "BLUE")):
            if layer.keys() >= set(colors):
                r, g, b = (layer[color] for color in colors)
                return r, g, b
    if not {"RY", "BY"} & set(names):
        for grey in ("Y", "L"):
            if grey in names:
                return grey, grey, grey
    raise AssetError(f"{path}: has channels {', '.join(names)}; an HDRI must have R, G and B")


def _read_hdr(path: Path, file: BinaryIO) -> NDArray[np.float32]:
    head = file.read(4096)
    # resolution string of the Radiance format (Reference Manual, picture format): rows from the
    # top, then columns from the left; OpenCV reads no other order
    size = re.search(rb"\n\n-Y +(\d{1,9}) +\+X +(\d{1,9})\n", head)
    if not head.startswith(b"#?") or not size:
        raise AssetError(f"{path}: not a Radiance HDR picture with rows from the top (-Y, +X)")
    height, width = int(size[1]), int(size[2])
    _check_size(path, width, height)
    # a line has 4 bytes and four channels in runs of at most 127 texels, or is not compressed
    smallest = height * min(4 + 4 * 2 * -(-width // 127), 4 * width)
    if os.fstat(file.fileno()).st_size - size.end() < smallest:
        raise AssetError(f"{path}: damaged Radiance HDR picture (the file is truncated)")
    log_level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        with without_native_messages():
            bgr = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    except cv2.error:
        bgr = None
    finally:
        cv2.utils.logging.setLogLevel(log_level)
    if bgr is None or bgr.shape != (height, width, 3) or bgr.dtype != np.float32:
        raise AssetError(f"{path}: damaged Radiance HDR picture")
    return np.ascontiguousarray(bgr[..., ::-1])


def _sanitized(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Replace NaN, infinity and negative values in place, and return the radiance."""
    unknown = np.zeros(radiance.shape[:2], bool)
    for flags, values in zip(unknown, radiance, strict=True):  # row by row: small masks at 16k
        if not np.isfinite(values).all():
            flags[:] = np.isnan(values).any(axis=-1)
            np.nan_to_num(values, copy=False, nan=0.0, posinf=HALF_MAX, neginf=0.0)
        np.clip(values, 0.0, _MAX_RADIANCE, out=values)
    for row in np.flatnonzero(unknown.any(axis=1)):
        around = slice(max(row - 1, 0), row + 2)
        known = ~unknown[around]
        total, count = (radiance[around] * known[..., None]).sum(0), known.sum(0)[:, None]
        total, count = (a + np.roll(a, 1, axis=0) + np.roll(a, -1, axis=0) for a in (total, count))
        radiance[row, unknown[row]] = (total / np.maximum(count, 1))[unknown[row]]
    return radiance
