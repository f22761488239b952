"""What every renderer script shares: the job it is given, its clocks, and the result it leaves.

Runs inside each peer's own environment, so it needs nothing but numpy. A job folder holds job.json,
and for each scene a GLB in metres, y up, whose nodes are 'container' and 'marker_2', 'marker_3',
... (the number is the marker's id), and a Radiance HDR picture that lights it.
"""

import json
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

CONTAINER, CONTAINER_ID = "container", 1

Z_UP_TO_Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
"""glTF 2.0, section 3.4: y is up."""


@dataclass(frozen=True)
class Shot:
    """One view of a scene.

    pose: float64 [4, 4], camera to world, metres, z up; the camera looks along its -z and its y is
    up, as OpenGL's and Blender's. focal_px: focal length in pixels. exposure: factor on radiance.
    markers: ids of the markers of which something is visible.
    """

    camera: str
    pose: np.ndarray
    focal_px: float
    exposure: float
    markers: list[int]

    @property
    def pose_y_up(self) -> np.ndarray:
        """The pose in the GLB's own frame."""
        return Z_UP_TO_Y_UP @ self.pose


@dataclass(frozen=True)
class SceneJob:
    """One scene: its number, its files, its turn of the light about the vertical, its views."""

    index: int
    glb: Path
    hdri: Path
    yaw_deg: float
    shots: list[Shot]


@dataclass(frozen=True)
class Job:
    """All that one renderer script has to do. size: (width, height). repeats: of each view."""

    seed: int
    size: tuple[int, int]
    repeats: int
    samples: int
    scenes: list[SceneJob]


def read_job(folder: Path) -> Job:
    """The job in `folder`."""
    plain = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    scenes = [
        SceneJob(
            scene["index"],
            folder / scene["glb"],
            folder / scene["hdri"],
            scene["yaw_deg"],
            [Shot(**{**shot, "pose": np.array(shot["pose"])}) for shot in scene["shots"]],
        )
        for scene in plain["scenes"]
    ]
    width, height = plain["size"]
    return Job(plain["seed"], (width, height), plain["repeats"], plain["samples"], scenes)


def object_id(node: str) -> int:
    """The id of a GLB node: 1 for the container, and what stands in a marker's name."""
    return CONTAINER_ID if node.startswith(CONTAINER) else int(node.split("_")[1].split(".")[0])


class Recorder:
    """Wall and core milliseconds by stage, and the last picture and ids of every view.

    A stage is 'set-up' (once a scene), 'colour' or 'labels' (each repeat of each view).
    """

    def __init__(self, out: Path, version: str) -> None:
        self._out, self._version = out, version
        self._laps: dict[str, list[tuple[float, float]]] = defaultdict(list)
        out.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def lap(self, stage: str) -> Iterator[None]:
        """Time what happens within; core time counts all threads of this process."""
        wall, cores = time.perf_counter(), time.process_time()
        yield
        took = time.perf_counter() - wall, time.process_time() - cores
        self._laps[stage].append((took[0] * 1e3, took[1] * 1e3))

    def keep(self, scene: SceneJob, shot: Shot, image: np.ndarray, ids: np.ndarray) -> None:
        """Save a view: image uint8 [H, W, 3] sRGB and ids [H, W], row 0 at the top."""
        stem = f"{scene.index:06d}_{shot.camera}"
        np.savez_compressed(self._out / f"{stem}.npz", image=image, ids=ids.astype(np.uint16))

    def save(self) -> None:
        """Write result.json: every lap, in the order in which it was made."""
        result: dict[str, Any] = {"version": self._version, "laps": self._laps}
        (self._out / "result.json").write_text(json.dumps(result), encoding="utf-8")


def nearest_id(pixels: np.ndarray, colors: dict[int, tuple[int, int, int]]) -> np.ndarray:
    """Ids [H, W] of pixels [H, W, 3] that were painted with `colors`, 0 being the background."""
    keys = np.array([0, *colors])
    palette = np.array([(0, 0, 0), *colors.values()], np.int32)
    gaps = np.abs(pixels[:, :, None].astype(np.int32) - palette).sum(axis=-1)
    return keys[gaps.argmin(axis=-1)]


def id_colors(ids: list[int]) -> dict[int, tuple[int, int, int]]:
    """A colour for each id, at least 42 of 255 from any other in some channel and from black."""
    levels = (0, 51, 102, 153, 204, 255)
    cells = [(r, g, b) for r in levels for g in levels for b in levels][1:]
    return {number: cells[(i * 37) % len(cells)] for i, number in enumerate(sorted(ids))}
