"""The test cases, and their path-traced references.

A case combines one of four cameras with one of eight lights, and is damaged or not, rusty or clean.
The first 8, 16 or 24 cases contain every light, camera and state equally often. Each reference
stores its scene, so changes to the sampling or the environments do not affect it.
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
"""Resolution factor per side of the traced images, each at SAMPLES / SCALE**2 samples.

The pixel filters of FILTERS are computed from these half pixels.
"""

CAMERAS = ("A", "B", "Cl", "Cr")
LIGHTS = ("venice", "sunrise", "night", "park", "city_2", "sky", "sunset", "dawn")
RUSTY = 0.2
_TIMES_TWO = (0, 2, 3, 1)  # times two in GF(4), which gives two orthogonal Latin squares

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Case:
    """One image to compare.

    Attributes:
        number: Position in `cases()`.
        camera: Camera name.
        light: Name of the environment.
        damaged: Damaged for certain, or never.
        rusty: Rust covers the share RUSTY, or nothing.
    """

    number: int
    camera: str
    light: str
    damaged: bool
    rusty: bool

    @property
    def config(self) -> Config:
        """The configuration that the case's scene is sampled from."""
        return Config.from_values(
            {
                "environment": {"names": [self.light]},
                "damage": {"probability": float(self.damaged)},
                "surface": {"rust_coverage": RUSTY if self.rusty else 0.0},
            }
        )

    @property
    def texel_mm(self) -> float:
        """Size in mm of the texels that Cycles sees; a quarter of a pixel of the closest camera."""
        return 3.0

    def drawn(self) -> Scene:
        """Sample the scene of the case with the current code."""
        return Generator(self.config, SEED, SIZE).scene(self.number)


def cases() -> list[Case]:
    """Return all 32 cases, in the order in which they are traced."""
    found: list[Case] = []
    for block in range(4):
        for i, light in enumerate(LIGHTS):
            state = _TIMES_TWO[i % 4] ^ block ^ (i // 4)
            camera = CAMERAS[i % 4 ^ block]
            found.append(Case(len(found), camera, light, bool(state & 1), bool(state & 2)))
    return found


def traced(count: int) -> list[Case]:
    """Return the cases among the first `count` that have a stored reference."""
    return [case for case in cases()[:count] if (FOLDER / f"{case.number:02d}.npz").exists()]


@dataclass(frozen=True, eq=False)
class Reference:
    """The path-traced reference of a case.

    Attributes:
        scene: The scene that was traced.
        exposure: Exposure of its camera at that time.
        radiance: Linear float32 [H, W, 3] before exposure, by filter (see FILTERS).
        inside: Mask [H, W] of the pixel centres whose ray hits a container or a spreader.
        depth_m: Distance along the optical axis in metres, for every DEPTH_STEP-th row and column.
            inf where nothing is hit. Ground and props are included.
        openness: Sky visibility [H, W] (Cycles' ambient occlusion), 1 in the open.
    """

    scene: Scene
    exposure: float
    radiance: dict[str, Array]
    inside: NDArray[np.bool_]
    depth_m: Array
    openness: Array


FILTERS = {"draft": "box", "balanced": "box", "fine": "box", "high": "box"}
"""Pixel filter of each quality at SIZE.

A box is the pixel's own square. `draft` has no filter and is compared with the box. A tent reaches
one pixel farther on each side; only images too large for nine samples per pixel use it.
"""

DEPTH_STEP = 8

_BRIGHTEST = 1000.0
"""Upper limit of stored radiance after exposure.

It is displayed as white. Compression could push values near the end of the half-float range beyond
it.
"""

_EXR = {
    "compression": OpenEXR.DWAB_COMPRESSION,
    "dwaCompressionLevel": 45.0,
    "type": OpenEXR.scanlineimage,
}


def filtered(halves: Array) -> dict[str, Array]:
    """Filter radiance [2H, 2W, 3] of half pixels to pixels [H, W, 3], by filter name.

    A tent also reads the half pixel beyond the image border, which repeats the last one.
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
    """Write a reference as NN.npz and NN.exr.

    The EXR holds half floats compressed with DWAB. Radiance is stored after exposure, because DWAB
    treats values below 1 as displayable.
    """
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
    """Read the reference of a case. Blender is not needed.

    Raises:
        FileNotFoundError: The case has not been traced.
    """
    with np.load(folder / f"{number:02d}.npz") as stored:
        scene = Scene.from_json(stored["scene"].tobytes().decode())
        inside = np.unpackbits(stored["inside"], axis=1, count=SIZE[0]).astype(bool)
        depth_m, exposure = stored["depth_m"], float(stored["exposure"])
    file = OpenEXR.File(str(folder / f"{number:02d}.exr"), separate_channels=True)
    planes = {name: c.pixels.astype(np.float32) for name, c in file.channels().items()}
    radiance: dict[str, Array] = {
        name: np.stack([planes[f"{name}.{c}"] for c in "RGB"], axis=-1) / exposure
        for name in sorted(set(FILTERS.values()))
    }
    return Reference(scene, exposure, radiance, inside, depth_m, planes["openness.Y"])
