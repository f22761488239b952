"""How much of an object is seen: what every kind of object's label has in common."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera import View
from fastgen.classes import SPREADER_ID
from fastgen.config import Config
from fastgen.geometry.mesh import Mesh
from fastgen.sample import Box, Frame
from fastgen.scene import Scene

_EDGE_SHARE = 0.01
_EDGE_PX = 2
"""Up to this much of an object may be missing along its edges, where rasterizers differ by a
rounding, before something is said to hide it."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One image and all that explains it. mesh: the scene's container at rest; spreader: as of
    shapes.spreader_outline."""

    frame: Frame
    scene: Scene
    view: View
    mesh: Mesh
    spreader: Mesh | None
    config: Config

    @cached_property
    def spreader_shown(self) -> NDArray[np.bool_]:
        """Pixels [H, W] that see the spreader."""
        return self.frame.ids == SPREADER_ID


class Visibility(TypedDict):
    """The members of Object that tell how much of a thing is seen."""

    visible_fraction: float
    truncated: bool
    occluded: bool
    ignored: bool


def visibility(config: Config, area: int, hidden: int, beyond: int) -> Visibility:
    """area: the object's visible pixels; hidden: those that it would cover alone as well; beyond:
    likewise outside the image."""
    whole = area + hidden + beyond
    fraction = area / whole if whole else 0.0
    rules = config.labels
    return {
        "visible_fraction": fraction,
        "truncated": bool(area) and beyond > 0,
        "occluded": bool(area) and hidden > max(_EDGE_PX, _EDGE_SHARE * (area + hidden)),
        "ignored": area < rules.min_visible_px or fraction < rules.min_visible_fraction,
    }


def mask_box(mask: NDArray[np.bool_]) -> Box | None:
    """Tight box of a mask [H, W], None where it is empty."""
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    return (x, y, x + width, y + height) if width else None


def float_box(bounds: NDArray[np.float64]) -> tuple[float, float, float, float] | None:
    """Bounds (x0, y0, x1, y1) to a thousandth of a pixel; None where they are not finite."""
    if not np.isfinite(bounds).all():
        return None
    x0, y0, x1, y1 = np.round(bounds, 3).tolist()
    return x0, y0, x1, y1


def window(target: NDArray[Any], box: Box) -> NDArray[Any]:
    """The part of `target` [H, W] within a box, as a view."""
    x0, y0, x1, y1 = box
    return target[y0:y1, x0:x1]
