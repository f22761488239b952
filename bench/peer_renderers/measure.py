"""Parts shared by the renderer scripts: the job, the timers and the result file.

This module runs in each peer's own environment, so it needs only numpy. A job folder contains
job.json and, for each scene, a GLB file and a Radiance HDR image that lights it. The GLB is in
metres, y up. Its nodes are 'container', 'marker_2', 'marker_3' and so on, where the number is the
marker's id.
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
"""Rotation into glTF's frame, where y is up (glTF 2.0, section 3.4)."""


@dataclass(frozen=True)
class Shot:
    """One view of a scene.

    Attributes:
        camera: Camera name.
        pose: Camera to world, float64 [4, 4], metres, z up. The camera looks along its -z axis with
            y up, as in OpenGL and Blender.
        focal_px: Focal length in pixels.
        exposure: Factor on radiance.
        markers: Ids of the markers that are at least partly visible.
    """

    camera: str
    pose: np.ndarray
    focal_px: float
    exposure: float
    markers: list[int]

    @property
    def pose_y_up(self) -> np.ndarray:
        """The pose in the GLB's own frame."""
        turned: np.ndarray = Z_UP_TO_Y_UP @ self.pose
        return turned


@dataclass(frozen=True)
class SceneJob:
    """One scene: index, files, rotation of the light about the vertical, and views."""

    index: int
    glb: Path
    hdri: Path
    yaw_deg: float
    shots: list[Shot]


@dataclass(frozen=True)
class Job:
    """The work for one renderer script.

    Attributes:
        seed: fastgen's seed.
        size: (width, height) in pixels.
        repeats: Draws per view.
        samples: Samples per pixel.
        scenes: The scenes to draw.
    """

    seed: int
    size: tuple[int, int]
    repeats: int
    samples: int
    scenes: list[SceneJob]


def read_job(folder: Path) -> Job:
    """Read the job in `folder`."""
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
    """Return the id of a GLB node: 1 for the container, the number in its name for a marker."""
    return CONTAINER_ID if node.startswith(CONTAINER) else int(node.split("_")[1].split(".")[0])


class Recorder:
    """Wall and CPU milliseconds by stage, and the last image and ids of each view.

    Stages are 'set-up' (once per scene), 'colour' and 'labels' (each repeat of each view).
    """

    def __init__(self, out: Path, version: str) -> None:
        self._out, self._version = out, version
        self._laps: dict[str, list[tuple[float, float]]] = defaultdict(list)
        out.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def lap(self, stage: str) -> Iterator[None]:
        """Time the body of the context; CPU time includes all threads of this process."""
        wall, cores = time.perf_counter(), time.process_time()
        yield
        took = time.perf_counter() - wall, time.process_time() - cores
        self._laps[stage].append((took[0] * 1e3, took[1] * 1e3))

    def keep(self, scene: SceneJob, shot: Shot, image: np.ndarray, ids: np.ndarray) -> None:
        """Save the image uint8 [H, W, 3] sRGB and the ids [H, W] of a view, row 0 at the top."""
        stem = f"{scene.index:06d}_{shot.camera}"
        np.savez_compressed(self._out / f"{stem}.npz", image=image, ids=ids.astype(np.uint16))

    def save(self) -> None:
        """Write result.json with all times in the order in which they were measured."""
        result: dict[str, Any] = {"version": self._version, "laps": self._laps}
        (self._out / "result.json").write_text(json.dumps(result), encoding="utf-8")


def nearest_id(pixels: np.ndarray, colors: dict[int, tuple[int, int, int]]) -> np.ndarray:
    """Return the ids [H, W] of pixels [H, W, 3] painted with `colors`; 0 is the background."""
    keys = np.array([0, *colors])
    palette = np.array([(0, 0, 0), *colors.values()], np.int32)
    gaps = np.abs(pixels[:, :, None].astype(np.int32) - palette).sum(axis=-1)
    ids: np.ndarray = keys[gaps.argmin(axis=-1)]
    return ids


def id_colors(ids: list[int]) -> dict[int, tuple[int, int, int]]:
    """Return a colour for each id.

    Any two colours, and each colour and black, differ by at least 51 of 255 in some channel.
    """
    levels = (0, 51, 102, 153, 204, 255)
    cells = [(r, g, b) for r in levels for g in levels for b in levels][1:]
    return {number: cells[(i * 37) % len(cells)] for i, number in enumerate(sorted(ids))}
