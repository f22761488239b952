"""Rebuild the .exr files and index.json of this folder from the packages with the originals.

Run by hand, in an empty folder, after downloading both packages:

    pip download --no-deps bpy==4.5.15
    npm pack @pmndrs/assets@1.7.0
    python collect.py bpy-4.5.15-*.whl pmndrs-assets-1.7.0.tgz OUT

Changes to the originals, none of which moves light by more than a few texels:

A sun whose red and green overflowed before the original was resized gets the colour of its halo.

Values below 0, left by the resizing filter around lights, are filled from their neighbours. The
light next to them is reduced by the added amount.

Values are clamped to the half-float range and saved as half floats with DWAB compression.
"""

import base64
import json
import re
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
from numpy.typing import NDArray

BPY = ("bpy 4.5.15 (PyPI)", "bpy/4.5/datafiles/studiolights/world/{}.exr")
PMNDRS = ("@pmndrs/assets 1.7.0 (npm)", "package/hdri/{}.exr.js")
LICENCE = "CC0-1.0"

# our name: (package, its name there, kinds); without hotel room, flats, studios, shopping halls
CHOSEN = {
    "city": (BPY, "city", ("overcast", "urban")),
    "courtyard": (BPY, "courtyard", ("day", "interior")),
    "forest": (BPY, "forest", ("day",)),
    "night": (BPY, "night", ("night",)),
    "sunrise": (BPY, "sunrise", ("dawn",)),
    "sunset": (BPY, "sunset", ("dusk", "waterside")),
    "city_2": (PMNDRS, "city", ("overcast", "urban")),
    "dawn": (PMNDRS, "dawn", ("dusk",)),
    "forest_2": (PMNDRS, "forest", ("day",)),
    "hall": (PMNDRS, "hall", ("interior",)),
    "lab": (PMNDRS, "lab", ("industrial", "interior")),
    "night_2": (PMNDRS, "night", ("night",)),
    "park": (PMNDRS, "park", ("day",)),
    "sky": (PMNDRS, "sky", ("day", "waterside")),
    "sunset_2": (PMNDRS, "sunset", ("dusk", "urban")),
    "venice": (PMNDRS, "venice", ("overcast", "dawn", "waterside")),
    "warehouse": (PMNDRS, "warehouse", ("industrial", "interior")),
    "workshop": (PMNDRS, "workshop", ("industrial", "interior")),
}
LUX = {
    "city": 30000,
    "courtyard": 20000,
    "forest": 10000,
    "night": 15,
    "sunrise": 11000,
    "sunset": 400,
    "dawn": 400,
    "forest_2": 5000,
    "night_2": 15,
    "park": 15000,
    "sky": 86000,
    "sunset_2": 400,
    "venice": 2000,
}
"""Estimated illuminance of level ground, where the kind's is a poor estimate; see SOURCES.md."""

_HALF_MAX = 65504.0
_NOISE = 0.01  # compression alone gives values down to a few thousandths below 0
_DWA_LEVEL = 20.0  # the default of 45 shows blocks in night skies


def decode(data: bytes) -> NDArray[np.float32]:
    """Return the radiance float32 [H, W, 3] of an EXR file's bytes."""
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(data)
        file.flush()
        channels = OpenEXR.File(file.name, separate_channels=True).channels()
        return np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=-1)


def restore_lost_channels(radiance: NDArray[np.float32]) -> None:
    """Restore red and green in place where they are lost next to a strong blue.

    The colour comes from the ring of texels around the lost ones.
    """
    size = np.abs(radiance)
    lost = (size[..., :2].max(-1) < 1e-3 * size[..., 2]) & (size[..., 2] > 1)
    if lost.any():
        ring = cv2.dilate(lost.astype(np.uint8), np.ones((3, 3))).astype(bool) & ~lost
        halo = np.median(radiance[ring] / radiance[ring][:, 2:], axis=0)
        radiance[lost] = radiance[lost][:, 2:] * halo


def fill_undershoot(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the radiance without negative values, with nearly the same sum around each light."""
    bad = radiance.min(-1) < -_NOISE
    positive = np.maximum(radiance, 0.0)
    filled, known = positive.copy(), ~bad
    logs = np.where(known[..., None], np.log(positive + 1e-6), 0.0).astype(np.float32)
    while not known.all():
        count = cv2.blur(known.astype(np.float32), (5, 5), borderType=cv2.BORDER_REPLICATE)
        mean = cv2.blur(logs, (5, 5), borderType=cv2.BORDER_REPLICATE)
        mean /= np.maximum(count, 1e-6)[..., None]
        now = ~known & (count > 1e-3)
        filled[now] = np.exp(mean[now])
        logs[now], known = mean[now], known | now
    near = cv2.dilate(bad.astype(np.uint8), np.ones((3, 3)))
    regions, label = cv2.connectedComponents(near)
    for region in range(1, regions):
        inside = label == region
        lights = inside & ~bad
        added = (filled - radiance)[inside].sum(0)
        light = filled[lights].sum(0)
        filled[lights] *= np.clip(1.0 - added / np.maximum(light, 1e-6), 0.5, 1.0)
    return filled


def collect(wheel: Path, tarball: Path, out: Path) -> None:
    """Write every chosen environment and index.json to `out`."""
    out.mkdir(parents=True, exist_ok=True)
    index = {}
    with zipfile.ZipFile(wheel) as bpy, tarfile.open(tarball) as pmndrs:
        for name, (package, there, kinds) in CHOSEN.items():
            member = package[1].format(there)
            if package is BPY:
                data = bpy.read(member)
            else:
                file = pmndrs.extractfile(member)
                assert file is not None
                text = re.search(rb"base64,([A-Za-z0-9+/=]+)", file.read())
                assert text is not None
                data = base64.b64decode(text[1])
            radiance = decode(data)
            restore_lost_channels(radiance)
            radiance = np.minimum(fill_undershoot(radiance), _HALF_MAX)
            header = {
                "compression": OpenEXR.DWAB_COMPRESSION,
                "dwaCompressionLevel": _DWA_LEVEL,
                "type": OpenEXR.scanlineimage,
            }
            channels = {"RGB": radiance.astype(np.float16)}
            OpenEXR.File(header, channels).write(str(out / f"{name}.exr"))
            index[name] = {
                "file": f"{name}.exr",
                "kind": list(kinds),
                "licence": LICENCE,
                "source": f"{package[0]}: {member}",
                **({"lux": LUX[name]} if name in LUX else {}),
            }
    (out / "index.json").write_text(json.dumps(index, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    collect(*(Path(argument) for argument in sys.argv[1:4]))
