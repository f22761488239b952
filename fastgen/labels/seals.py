"""Labels of seals."""

import numpy as np

from fastgen.labels.coverage import boxes, covered, facing, project
from fastgen.labels.visibility import Shot, float_boxes, visibility
from fastgen.sample import Keypoint, Object
from fastgen.scene.limits import HASPS


def seal_objects(shot: Shot) -> list[Object]:
    """Return the seals of a scene, in the order of Scene.seals."""
    seals = shot.prepared.seals
    if seals is None:
        return []
    ids, view = shot.frame.ids, shot.view
    numbers = shot.prepared.numbers
    own = np.array([numbers.seal(seal) for seal in shot.scene.seals])
    least = numbers.first_seal
    count = len(own)
    seen_boxes, areas = shot.boxes_on_container(ids, least, least + HASPS)
    seen = project(seals.facets, view)
    bounds = float_boxes(boxes(seen.pixels, seen.facets.owner, count))
    areas = areas.take(own - least)
    hidden, beyond = np.zeros((2, count), np.int64)
    if areas.any():  # only visible seals need their unoccluded area
        polygons, owner = seen.polygons, seen.facets.owner.take(seen.facets.corners[:, 0])
        front = np.flatnonzero(facing(polygons))
        alone = covered(polygons.take(front, axis=0), owner.take(front), count, view.size)
        pixel, whose = alone.pixels()
        lost = whose[ids.ravel().take(pixel) != own.take(whose)]
        hidden, beyond = np.bincount(lost, minlength=count), alone.beyond
    middles = _middles(shot, own)
    return [
        Object(
            id=int(own[i]),
            class_name="seal",
            instance=i + 1,
            bbox=seen_boxes[own[i] - least],
            amodal_bbox=bounds[i],
            area=int(areas[i]),
            keypoints=(middles[i],),
            **visibility(
                shot.config, shot.view.size, int(areas[i]), int(hidden[i]), int(beyond[i])
            ),
        )
        for i in range(count)
    ]


def _middles(shot: Shot, own: np.ndarray) -> list[Keypoint]:
    """Return the middle of each seal; it is visible if its pixel shows the seal with this id."""
    assert shot.prepared.seals is not None
    pixels, depth = shot.view.project(shot.prepared.seals.middles_mm)
    inside = (depth > 0) & ((pixels >= 0) & (pixels < shot.view.size)).all(axis=1)
    found: list[Keypoint] = []
    for (x, y), within, value in zip(pixels.tolist(), inside, own, strict=True):
        shown = within and shot.frame.ids[int(y), int(x)] == value
        found.append((round(x, 3), round(y, 3), 2 if shown else 1) if within else (0.0, 0.0, 0))
    return found
