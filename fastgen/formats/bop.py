"""BOP format for the poses of containers: bop_toolkit, docs/bop_datasets_format.md.

Lengths are in millimetres, matrices are row-major and pixel centres are at whole numbers. Each
split is one BOP scene. Image ids count the images of the whole dataset, and go on counting when
datasets are merged.

Masks of full silhouettes (`mask`) are not written; `scene_gt_info.json` has their boxes and pixel
counts. `px_count_valid` counts pixels of the visible part only.
"""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fastgen.config.config import Config
from fastgen.files.images import png
from fastgen.formats.depth import depth_mm
from fastgen.formats.format import DatasetFiles, Files, Format, Records, Same
from fastgen.formats.item import Item
from fastgen.formats.scene_file import view_values
from fastgen.geometry.shape_library import SHAPES
from fastgen.scene.container_kinds import KINDS

OBJECT_IDS = {kind: i + 1 for i, kind in enumerate(KINDS)}
"""Object id by kind of container."""


_OF_IMAGE = re.compile(r"(bop/\w+/\d+/(?:rgb|depth|mask_visib)/)(\d{6,})(\D.*)")
"""Path of a file of one image: its folder, the number of the image, and the rest."""

_LENS_KEYS = ("distortion_model", "distortion")


class _Bop(Format):
    name = "bop"
    fits_archives = False  # poses are in one file for all images

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        sample = item.sample
        folder = f"bop/{item.split}/000000"
        name = f"{item.number:06d}"
        files: Files = {
            f"{folder}/rgb/{name}.jpg": Same(item.image_path),
            f"{folder}/depth/{name}.png": png(depth_mm(sample.depth)),
        }
        intrinsics = sample.view.intrinsics.copy()
        intrinsics[:2, 2] -= 0.5
        camera = {"cam_K": intrinsics.ravel().tolist(), "depth_scale": 1.0}
        if sample.view.distortion:  # an addition of ours: BOP has no lens distortion
            camera |= {key: view_values(sample.view)[key] for key in _LENS_KEYS}
        poses: list[dict[str, Any]] = []
        infos: list[dict[str, Any]] = []
        for thing in item.containers:
            if thing.bbox is None or thing.amodal_bbox is None:
                continue
            mask = sample.container_mask(thing.container)
            path = f"{folder}/mask_visib/{name}_{len(poses):06d}.png"
            files[path] = png(np.asarray(mask, np.uint8) * np.uint8(255))
            seen = sample.container_at(thing.container)
            poses.append(
                {
                    "cam_R_m2c": seen.view.rotation.ravel().tolist(),
                    "cam_t_m2c": seen.view.translation_mm.tolist(),
                    "obj_id": OBJECT_IDS[seen.container.kind],
                }
            )
            infos.append(
                {
                    "bbox_obj": _corner_and_size(thing.amodal_bbox),
                    "bbox_visib": _corner_and_size(thing.bbox),
                    "px_count_all": round(thing.area / thing.visible_fraction),
                    "px_count_valid": int(np.count_nonzero(mask & np.isfinite(sample.depth))),
                    "px_count_visib": thing.area,
                    "visib_fract": thing.visible_fraction,
                }
            )
        return files, {"camera": camera, "gt": poses, "info": infos}

    def renumbered(self, path: str, by: int) -> str:
        found = _OF_IMAGE.fullmatch(path)
        return f"{found[1]}{int(found[2]) + by:06d}{found[3]}" if found else path

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        for name, key in (("camera", "camera"), ("gt", "gt"), ("gt_info", "info")):
            yield f"bop/{split}/000000/scene_{name}.json", _by_image(records, key)

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        return _models()


def _by_image(records: Records, key: str) -> Iterator[str]:
    yield "{"
    for count, record in enumerate(records()):
        fact = record["facts"]["bop"]
        yield f'{"," if count else ""}\n"{record["number"]}": {json.dumps(fact[key])}'
    yield "}\n"


def _models() -> Iterator[tuple[str, bytes]]:
    """Yield a PLY model in mm of each kind of container, with nominal corrugation."""
    import trimesh
    from trimesh.exchange.ply import export_ply

    infos = {}
    for kind, number in OBJECT_IDS.items():
        mesh = SHAPES.container(kind)
        low, high = (np.asarray(bound, float) for bound in mesh.bounds_mm)
        infos[str(number)] = {
            "diameter": float(np.linalg.norm(high - low)),
            **{f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)},
            **{f"size_{axis}": float(v) for axis, v in zip("xyz", high - low, strict=True)},
        }
        body = trimesh.Trimesh(mesh.positions_mm, mesh.triangles, process=False)
        data: bytes = export_ply(body)
        yield f"bop/models/obj_{number:06d}.ply", data
    yield "bop/models/models_info.json", json.dumps(infos, indent=1).encode()


def _corner_and_size(box: tuple[float, float, float, float]) -> list[float]:
    x0, y0, x1, y1 = box
    return [x0, y0, x1 - x0, y1 - y0]


FORMAT = _Bop()
