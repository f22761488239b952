"""Check of an OpenEXR file's layout before a decoder sees the file.

A decoder allocates what a file claims: the OpenEXR library takes all memory for a tile height of
four million in a file of 400 kB. So the claims are compared with the file's size and with limits.
The layout is that of "OpenEXR File Layout", https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

LARGEST_DECODED = 4 << 30
"""Most bytes of all pixels of a file; float32 RGBA of the largest HDRI has half of them."""

_MAGIC = 20000630
_TILED, _DEEP, _MULTIPART = 0x200, 0x800, 0x1000

_LARGEST_HEADER = 4 << 20
_MOST_CHUNKS = 1 << 20
_LARGEST_TILE = 4096
_LARGEST_COORDINATE = 1 << 30

_PIXEL_BYTES = {0: 4, 1: 2, 2: 4}
"""Bytes of a value by pixel type: uint32, half and float32."""

_CHUNK_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32, 256, 1)
"""Lines of a chunk by number of the compression method."""

_KINDS = {"scanlineimage": False, "tiledimage": True}
"""Whether a part of this type has tiles. Parts with several samples per pixel are not supported."""


@dataclass(frozen=True)
class _Part:
    """Claims of one part's header.

    Attributes:
        window: x0, y0, x1, y1 of the pixels, inclusive.
        pixel_bytes: Bytes of a pixel with all channels.
        chunk_lines: Lines of a chunk if there are no tiles.
        tile: Width and height of a tile, or None.
        levels: 0 for one level, 1 for a mip map, 2 for levels of each width and height.
        round_up: Sizes of levels are rounded up.
    """

    window: tuple[int, int, int, int]
    pixel_bytes: int
    chunk_lines: int
    tile: tuple[int, int] | None = None
    levels: int = 0
    round_up: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        x0, y0, x1, y1 = self.window
        return x1 - x0 + 1, y1 - y0 + 1

    @property
    def chunk_bytes(self) -> int:
        """Bytes of the largest chunk when decoded."""
        width, height = self.tile or (self.size[0], self.chunk_lines)
        return width * height * self.pixel_bytes

    def chunk_count(self) -> int:
        """Return the number of chunks."""
        if self.tile is None:
            return -(-self.size[1] // self.chunk_lines)
        across, down = (
            [-(-extent // side) for extent in _extents(whole, self.round_up)]
            for whole, side in zip(self.size, self.tile, strict=True)
        )
        if self.levels == 0:
            return across[0] * down[0]
        if self.levels == 2:
            return sum(across) * sum(down)
        most = max(len(across), len(down))
        across, down = (each + [1] * (most - len(each)) for each in (across, down))
        return sum(x * y for x, y in zip(across, down, strict=True))


def check_layout(stream: BinaryIO) -> tuple[int, int]:
    """Check everything that an OpenEXR file claims about sizes and places.

    Args:
        stream: The file, open for reading and at its start.

    Returns:
        Width and height of the first part in pixels.

    Raises:
        ValueError: The file is damaged, cut off, not supported, or claims more than it holds.
    """
    file_size = os.fstat(stream.fileno()).st_size
    header = _Reader(stream.read(_LARGEST_HEADER))
    magic, version = header.take("<iI")
    if magic != _MAGIC or version & 0xFF != 2:
        raise ValueError("it has no OpenEXR signature")
    if version & _DEEP:
        raise ValueError("deep images are not supported")
    multipart = bool(version & _MULTIPART)
    parts = list(_parts(header, multipart, bool(version & _TILED)))
    if not parts:
        raise ValueError("its header is empty")
    decoded = sum(part.size[0] * part.size[1] * part.pixel_bytes for part in parts)
    largest = max([decoded, *(part.chunk_bytes for part in parts)])
    if largest > LARGEST_DECODED:
        raise ValueError(
            f"its pixels take {largest:,} bytes, more than {LARGEST_DECODED:,}; "
            "save only the channels R, G and B"
        )
    counts = [part.chunk_count() for part in parts]
    if sum(counts) > _MOST_CHUNKS:
        raise ValueError(f"it has {sum(counts):,} chunks, more than {_MOST_CHUNKS:,}")
    stream.seek(header.at)
    table = stream.read(8 * sum(counts))
    if len(table) < 8 * sum(counts):
        raise ValueError("the file is truncated")
    places = iter(struct.unpack(f"<{sum(counts)}Q", table))
    first = header.at + len(table)
    for number, (part, count) in enumerate(zip(parts, counts, strict=True)):
        for _ in range(count):
            _check_chunk(stream, next(places), (first, file_size), part, number, multipart)
    return parts[0].size


class _Reader:
    """Reads values from the start of a file."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at = data, 0

    def take(self, layout: str) -> tuple[int, ...]:
        return struct.unpack(layout, self.bytes(struct.calcsize(layout)))

    def bytes(self, count: int) -> bytes:
        if not 0 <= count <= len(self._data) - self.at:
            raise ValueError("its header is damaged, truncated or larger than 4 MiB")
        self.at += count
        return self._data[self.at - count : self.at]

    def text(self) -> str:
        end = self._data.find(b"\0", self.at, self.at + 256)
        if end < 0:
            raise ValueError("its header has a name without an end")
        return self.bytes(end + 1 - self.at)[:-1].decode("latin-1")


def _parts(header: _Reader, multipart: bool, tiled: bool) -> Iterator[_Part]:
    while attributes := _attributes(header):
        yield _part(attributes, multipart, tiled)
        if not multipart:
            return


def _attributes(header: _Reader) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    while name := header.text():
        header.text()  # its type, which the name implies
        (size,) = header.take("<i")
        if name in found:
            raise ValueError(f"its header has {name} twice")
        found[name] = header.bytes(size)
    return found


def _part(attributes: dict[str, bytes], multipart: bool, tiled: bool) -> _Part:
    kind = attributes.get("type", b"").rstrip(b"\0").decode("latin-1")
    if kind or multipart:
        if kind not in _KINDS or (not multipart and _KINDS[kind] != tiled):
            raise ValueError(f"parts of type {kind!r} are not supported here")
        tiled = _KINDS[kind]
    window = _values(attributes, "dataWindow", "<4i")
    x0, y0, x1, y1 = window
    if not (x0 <= x1 and y0 <= y1) or max(map(abs, window)) > _LARGEST_COORDINATE:
        raise ValueError(f"its data window is {x0}, {y0} to {x1}, {y1}")
    (method,) = _values(attributes, "compression", "<B")
    if method >= len(_CHUNK_LINES):
        raise ValueError(f"the compression method {method} is unknown")
    part = _Part((x0, y0, x1, y1), _pixel_bytes(attributes), _CHUNK_LINES[method])
    if tiled:
        width, height, mode = _values(attributes, "tiles", "<IIB")
        limits = (max(side, _LARGEST_TILE) for side in part.size)
        if not all(0 < side <= limit for side, limit in zip((width, height), limits, strict=True)):
            raise ValueError(f"its tiles have {width}x{height} pixels")
        levels, rounding = mode & 15, mode >> 4
        if levels > 2 or rounding > 1:
            raise ValueError(f"its levels have the unknown mode {mode}")
        part = _Part(part.window, part.pixel_bytes, 1, (width, height), levels, bool(rounding))
    if "chunkCount" in attributes:
        (count,) = _values(attributes, "chunkCount", "<i")
        if count != part.chunk_count():
            raise ValueError(f"it claims {count} chunks, and has {part.chunk_count()}")
    return part


def _values(attributes: dict[str, bytes], name: str, layout: str) -> tuple[int, ...]:
    if len(attributes.get(name, b"")) != struct.calcsize(layout):
        raise ValueError(f"its header has no valid {name}")
    return struct.unpack(layout, attributes[name])


def _pixel_bytes(attributes: dict[str, bytes]) -> int:
    """Return the bytes of all channels of a pixel, as if none were subsampled."""
    total, channels = 0, _Reader(attributes.get("channels", b""))
    while channels.text():
        kind, _, across, down = channels.take("<iIii")
        if kind not in _PIXEL_BYTES or across < 1 or down < 1:
            raise ValueError("its list of channels is damaged")
        total += _PIXEL_BYTES[kind]
    if not total:
        raise ValueError("it has no channels")
    return total


def _extents(whole: int, round_up: bool) -> Iterator[int]:
    """Yield the width or height of every level."""
    while True:
        yield whole
        if whole == 1:
            return
        whole = (whole + round_up) // 2


def _check_chunk(
    stream: BinaryIO,
    place: int,
    limits: tuple[int, int],
    part: _Part,
    number: int,
    multipart: bool,
) -> None:
    """Check where one chunk is, and what it claims about its size and its place in the image."""
    layout = struct.Struct("<" + "i" * multipart + ("iiii" if part.tile else "i") + "i")
    start, end = limits
    if not start <= place <= end - layout.size:
        raise ValueError("the file is truncated or its table of chunks is damaged")
    values = layout.unpack(os.pread(stream.fileno(), layout.size, place))
    size = values[-1]
    if not 0 <= size <= min(part.chunk_bytes, end - place - layout.size):
        raise ValueError("the file is truncated or a chunk claims more than it holds")
    line = values[multipart]
    inside = part.tile or part.window[1] <= line <= part.window[3]
    if (multipart and values[0] != number) or not inside:
        raise ValueError("a chunk claims a place outside of the image")
