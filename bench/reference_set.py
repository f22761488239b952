"""The scenes that path-traced references exist of, and the references themselves.

A case joins one of four cameras with one of eight lights, and is damaged or sound, rusty or clean.
Any prefix of a multiple of 8 cases holds every light as often as every other, every camera and
every state too. What a case shows is kept as a Scene beside its reference, so that neither other
distributions nor other environments change it.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from fastgen import Config, Generator
from fastgen.scene import Scene

FOLDER = Path(__file__).parent / "references"
SIZE = (320, 320)
SEED = 3
SAMPLES = 1024
SCALE = 2
"""References are traced with this many pixels a side for one, at SAMPLES / SCALE**2 samples each:
from half pixels both filters follow that images are compared under."""

CAMERAS = ("A", "B", "Cl", "Cr")
LIGHTS = ("venice", "sunrise", "night", "park", "city_2", "sky", "sunset", "dawn")
RUSTY = 0.2
_TIMES_TWO = (0, 2, 3, 1)  # in the field of four elements: makes two orthogonal Latin squares

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Case:
    """One image to compare. rusty: RUSTY of the sheet, else none; damaged: certainly or never."""

    number: int
    camera: str
    light: str
    damaged: bool
    rusty: bool

    @property
    def config(self) -> Config:
        """The distribution that its scene is drawn from."""
        return Config.from_values(
            {
                "environment": {"names": [self.light]},
                "damage": {"probability": float(self.damaged)},
                "surface": {"rust_coverage": RUSTY if self.rusty else 0.0},
            }
        )

    def drawn(self) -> Scene:
        """Its scene as the present sampling draws it."""
        return Generator(self.config, SEED, SIZE).scene(self.number)


def cases() -> list[Case]:
    """All 32 cases, in the order in which they are traced."""
    found = []
    for block in range(4):
        for i, light in enumerate(LIGHTS):
            state = _TIMES_TWO[i % 4] ^ block ^ (i // 4)
            camera = CAMERAS[i % 4 ^ block]
            found.append(Case(len(found), camera, light, bool(state & 1), bool(state & 2)))
    return found


def traced(count: int) -> list[Case]:
    """Those of the first `count` cases whose reference is at hand."""
    return [case for case in cases()[:count] if (FOLDER / f"{case.number:02d}.npz").exists()]


@dataclass(frozen=True, eq=False)
class Reference:
    """What Cycles makes of a case.

    scene: what was traced. exposure: of its camera then. radiance: linear float32 [H, W, 3], not
    yet exposed, by filter, see FILTERS. inside: which rays through pixel centres [H, W] hit
    something; depth_m: how far along the axis, of every DEPTH_STEP-th one, inf where nothing;
    openness: ambient occlusion there [H, W], 1 in the open.
    """

    scene: Scene
    exposure: float
    radiance: dict[str, Array]
    inside: NDArray[np.bool_]
    depth_m: Array
    openness: Array


FILTERS = {"draft": "box", "balanced": "box", "fine": "box", "high": "box"}
"""The pixel filter of each quality at SIZE: a box is the pixel's square; `draft` has none and is
held to it. A tent reaches a pixel to each side; only images too large for nine samples have it."""

DEPTH_STEP = 8

_BRIGHTEST = 1000.0
"""Displayed as white; nearer the end of half floats compression could pass it."""

_EXR = {
    "compression": OpenEXR.DWAB_COMPRESSION,
    "dwaCompressionLevel": 45.0,
    "type": OpenEXR.scanlineimage,
}


def filtered(halves: Array) -> dict[str, Array]:
    """Radiance [2H, 2W, 3] of half pixels as that of pixels [H, W, 3], by filter.

    The half pixel beyond the border of the image, which a tent asks for, repeats the last one.
    """
    return {
        name: _along(_along(halves.astype(np.float64), 0, weights), 1, weights).astype(np.float32)
        for name, weights in {"box": (0, 4, 4, 0), "tent": (1, 3, 3, 1)}.items()
    }


def _along(image: Array, axis: int, eighths: tuple[int, ...]) -> Array:
    rows = np.moveaxis(image, axis, 0)
    padded = np.concatenate([rows[:1], rows, rows[-1:]])
    parts = [w / 8 * padded[i : i + len(rows) : 2] for i, w in enumerate(eighths)]
    return np.moveaxis(np.sum(parts, axis=0), 0, axis)


def save(reference: Reference, folder: Path, number: int) -> None:
    """Write NN.npz and NN.exr: exposed radiance in half floats that DWAB compresses, which takes
    what is below 1 for display."""
    planes = {"openness.Y": reference.openness}
    for name, image in reference.radiance.items():
        for c, channel in enumerate("RGB"):
            exposed = image[..., c] * reference.exposure
            planes[f"{name}.{channel}"] = np.minimum(exposed, _BRIGHTEST)
    halves = {name: np.ascontiguousarray(p.astype(np.float16)) for name, p in planes.items()}
    folder.mkdir(parents=True, exist_ok=True)
    OpenEXR.File(dict(_EXR), halves).write(str(folder / f"{number:02d}.exr"))
    np.savez_compressed(
        folder / f"{number:02d}.npz",
        scene=np.frombuffer(json.dumps(json.loads(reference.scene.to_json())).encode(), np.uint8),
        exposure=reference.exposure,
        inside=np.packbits(reference.inside, axis=1),
        depth_m=reference.depth_m.astype(np.float32),
    )


def load(number: int, folder: Path = FOLDER) -> Reference:
    """The reference of a case, without Blender. FileNotFoundError where it was never traced."""
    with np.load(folder / f"{number:02d}.npz") as stored:
        scene = Scene.from_json(stored["scene"].tobytes().decode())
        inside = np.unpackbits(stored["inside"], axis=1, count=SIZE[0]).astype(bool)
        depth_m, exposure = stored["depth_m"], float(stored["exposure"])
    file = OpenEXR.File(str(folder / f"{number:02d}.exr"), separate_channels=True)
    planes = {name: c.pixels.astype(np.float32) for name, c in file.channels().items()}
    radiance = {
        name: np.stack([planes[f"{name}.{c}"] for c in "RGB"], axis=-1) / exposure
        for name in sorted(set(FILTERS.values()))
    }
    return Reference(scene, exposure, radiance, inside, depth_m, planes["openness.Y"])
