"""HDRI files that claim more than they hold, so that a decoder would take all memory or crash."""

import struct

import cv2
import numpy as np
import OpenEXR
import pytest

from fastgen.errors import AssetError
from fastgen.light import hdri
from fastgen.light.hdri import load_radiance

pytestmark = pytest.mark.usefixtures("guarded")

COMPRESSIONS = [
    *("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"),
    *("HTJ2K256", "HTJ2K32"),
]
LOSSLESS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")
MANY = 4_000_000


PICTURE = np.random.default_rng(5).random((150, 300, 3)).astype(np.float16)


def tiles(width=64, height=32, mode=None):
    made = OpenEXR.TileDescription()
    made.xSize, made.ySize = width, height
    if mode is not None:
        made.mode = mode
    return made


def header_of(kind, compression="ZIP"):
    method = getattr(OpenEXR, f"{compression}_COMPRESSION")
    if kind == "tiles":
        return {"compression": method, "type": OpenEXR.tiledimage, "tiles": tiles()}
    return {"compression": method, "type": OpenEXR.scanlineimage}


def write(path, kind="lines", compression="ZIP"):
    """Write a file of lines, tiles, or two parts, the second one tiled."""
    if kind == "parts":
        parts = [
            OpenEXR.Part(header_of("lines", compression), {"RGB": PICTURE}, name="sky"),
            OpenEXR.Part(
                header_of("tiles", compression), {"Z": PICTURE[..., 0].copy()}, name="depth"
            ),
        ]
        OpenEXR.File(parts).write(str(path))
    else:
        OpenEXR.File(header_of(kind, compression), {"RGB": PICTURE}).write(str(path))
    return path


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("kind", ["lines", "tiles", "parts"])
def test_files_of_every_layout_are_read(tmp_path, kind, compression):
    read = load_radiance(write(tmp_path / "sky.exr", kind, compression))
    exact = compression in LOSSLESS
    np.testing.assert_allclose(read, PICTURE, atol=0 if exact else 0.2)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes of an undamaged file of each kind."""
    folder = tmp_path_factory.mktemp("whole")
    kinds = ("lines", "tiles", "parts")
    return {kind: write(folder / f"{kind}.exr", kind).read_bytes() for kind in kinds}


@pytest.fixture
def no_reader(monkeypatch):
    """Fail if a library sees the file."""

    def seen(*_, **__):
        pytest.fail("the decoder has seen the file")

    monkeypatch.setattr(hdri.OpenEXR, "File", seen)
    monkeypatch.setattr(hdri.OpenEXR, "InputFile", seen)
    monkeypatch.setattr(hdri.cv2, "imread", seen)


def value_at(data, name, last=False):
    """Return the offset of an attribute's value, from its name and type."""
    find = data.rindex if last else data.index
    start = find(name + b"\0") + len(name) + 1
    return data.index(b"\0", start) + 5


def patched(data, name, layout, values, last=False):
    at = value_at(data, name, last)
    return data[:at] + struct.pack(layout, *values) + data[at + struct.calcsize(layout) :]


def with_size(data, name, size):
    at = value_at(data, name) - 4
    return data[:at] + struct.pack("<i", size) + data[at + 4 :]


def table_of(data):
    """Return the offset of the table of chunks of a file with one part."""
    at = 8
    while data[at]:
        at = data.index(b"\0", data.index(b"\0", at) + 1) + 1
        at += 4 + struct.unpack_from("<i", data, at)[0]
    return at + 1


def with_chunk(data, offset, value):
    """Change a number of the first chunk's head."""
    at = struct.unpack_from("<Q", data, table_of(data))[0] + offset
    return data[:at] + struct.pack("<i", value) + data[at + 4 :]


def with_place(data, place):
    at = table_of(data)
    return data[:at] + struct.pack("<Q", place) + data[at + 8 :]


def with_channels(data, count):
    """Give the header `count` channels of float32, and a size of 16384x8192."""
    at = value_at(data, b"channels")
    (size,) = struct.unpack_from("<i", data, at - 4)
    listed = b"".join(
        f"c{number:04}".encode() + b"\0" + struct.pack("<iIii", 2, 0, 1, 1)
        for number in range(count)
    )
    data = data[: at - 4] + struct.pack("<i", len(listed) + 1) + listed + b"\0" + data[at + size :]
    return patched(data, b"dataWindow", "<4i", (0, 0, 16383, 8191))


LINES = {
    "wide": lambda d: patched(d, b"dataWindow", "<4i", (0, 0, 2**30, 149)),
    "high": lambda d: patched(d, b"dataWindow", "<4i", (0, 0, 299, 2**30)),
    "far": lambda d: patched(d, b"dataWindow", "<4i", (-(2**31), -(2**31), 2**31 - 1, 2**31 - 1)),
    "inverted": lambda d: patched(d, b"dataWindow", "<4i", (299, 149, 0, 0)),
    "large": lambda d: patched(d, b"dataWindow", "<4i", (0, 0, 16383, 8191)),
    "channels": lambda d: with_channels(d, 100),
    "no channels": lambda d: with_channels(d, 0),
    "compression": lambda d: patched(d, b"compression", "<B", (99,)),
    "deep": lambda d: d[:5] + b"\x08" + d[6:],
    "deep type": lambda d: d.replace(b"scanlineimage", b"deepscanline\0"),
    "tiles without a description": lambda d: d[:5] + b"\x02" + d[6:],
    "long attribute": lambda d: with_size(d, b"lineOrder", 2**31 - 1),
    "negative attribute": lambda d: with_size(d, b"lineOrder", -5),
    "no end": lambda d: d[:8] + b"a" * len(d[8:]),
    "chunk size": lambda d: with_chunk(d, 4, 2**31 - 1),
    "negative chunk": lambda d: with_chunk(d, 4, -1),
    "chunk line": lambda d: with_chunk(d, 0, 2**31 - 1),
    "chunk above": lambda d: with_chunk(d, 0, -16),
    "chunk in the header": lambda d: with_place(d, 8),
    "chunk nowhere": lambda d: with_place(d, 0),
    "chunk beyond": lambda d: with_place(d, 2**64 - 1),
    "cut": lambda d: d[: len(d) // 2],
    "cut table": lambda d: d[: table_of(d) + 20],
    "last byte": lambda d: d[:-1],
}
TILES = {
    "tile height": lambda d: patched(d, b"tiles", "<IIB", (64, MANY, 0)),
    "tile width": lambda d: patched(d, b"tiles", "<IIB", (MANY, 32, 0)),
    "tile sides": lambda d: patched(d, b"tiles", "<IIB", (2**32 - 1, 2**32 - 1, 0)),
    "no tile": lambda d: patched(d, b"tiles", "<IIB", (0, 0, 0)),
    "small tiles": lambda d: patched(d, b"tiles", "<IIB", (1, 1, 0)),
    "mip maps": lambda d: patched(d, b"tiles", "<IIB", (64, 32, 1)),
    "unknown levels": lambda d: patched(d, b"tiles", "<IIB", (64, 32, 7)),
    "wide": lambda d: patched(d, b"dataWindow", "<4i", (0, 0, 2**30, 149)),
    "tile size": lambda d: with_chunk(d, 16, 2**31 - 1),
}
PARTS = {
    "chunks": lambda d: patched(d, b"chunkCount", "<i", (2**31 - 1,)),
    "chunks of the second": lambda d: patched(d, b"chunkCount", "<i", (2**31 - 1,), last=True),
    "tile height": lambda d: patched(d, b"tiles", "<IIB", (64, MANY, 0)),
    "second window": lambda d: patched(d, b"dataWindow", "<4i", (0, 0, 2**29, 2**29), last=True),
    "no part": lambda d: d[:8] + b"\0" + d[9:],
}
CASES = [
    (kind, name, change)
    for kind, changes in (("lines", LINES), ("tiles", TILES), ("parts", PARTS))
    for name, change in changes.items()
]


@pytest.mark.parametrize(
    ("kind", "change"),
    [(kind, change) for kind, _, change in CASES],
    ids=[f"{kind}-{name}" for kind, name, _ in CASES],
)
def test_no_decoder_sees_a_file_that_claims_too_much(
    tmp_path, whole, no_reader, capfd, kind, change
):
    path = tmp_path / "sky.exr"
    path.write_bytes(change(whole[kind]))
    with pytest.raises(AssetError, match=r"sky\.exr: ") as caught:
        load_radiance(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", ["lines", "tiles", "parts"])
def test_flipped_bytes_end_in_words_or_an_image_and_print_nothing(tmp_path, whole, capfd, kind):
    rng = np.random.default_rng(7)
    path = tmp_path / "sky.exr"
    refused = 0
    for _ in range(150):
        data = bytearray(whole[kind])
        for place in rng.integers(4, min(len(data), 1500), 2):
            data[place] = rng.integers(256)
        path.write_bytes(data)
        try:
            assert load_radiance(path).shape[2] == 3
        except AssetError:
            refused += 1
    assert refused > 20
    assert capfd.readouterr().err == ""


def test_a_library_that_prints_is_not_heard(tmp_path, whole, capfd):
    """A chunk that only the decoder can refuse, because its compressed data are damaged."""
    data = whole["lines"]
    at = struct.unpack_from("<Q", data, table_of(data))[0] + 8
    path = tmp_path / "sky.exr"
    path.write_bytes(data[:at] + b"\xff" * 200 + data[at + 200 :])
    with pytest.raises(AssetError, match=r"sky\.exr: damaged OpenEXR file"):
        load_radiance(path)
    assert capfd.readouterr().err == ""


HDR = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"


@pytest.mark.parametrize(
    "data",
    [
        HDR + b"-Y 8192 +X 16384\n",
        HDR + b"-Y 8192 +X 16384\n" + b"\x02\x02\x40\x00" * 5000,
        HDR + b"-Y 99999999999 +X 99999999999\n",
        HDR + b"-Y " + b"9" * 3000 + b" +X 4\n",
        HDR + b"-Y 4096 +X 2147483647\n",
        HDR.replace(b"\n\n", b"\n") + b"-Y 8192 +X 16384\n",
        b"#?RADIANCE\n" + b"\n" * 5000 + b"-Y 8192 +X 16384\n",
    ],
)
def test_no_decoder_sees_a_radiance_file_that_claims_too_much(tmp_path, no_reader, capfd, data):
    (tmp_path / "sky.hdr").write_bytes(data)
    with pytest.raises(AssetError, match=r"sky\.hdr: "):
        load_radiance(tmp_path / "sky.hdr")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("width", [256, 1000, 4096])
def test_a_radiance_file_of_one_color_is_read(tmp_path, width):
    """Files of the smallest possible size, whose lines are runs only."""
    path = tmp_path / "sky.hdr"
    cv2.imwrite(str(path), np.full((width // 2, width, 3), 0.5, np.float32))
    assert path.stat().st_size < width * width
    assert (load_radiance(path) == 0.5).all()
