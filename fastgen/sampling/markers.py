"""Sampling of dangerous-goods markers: the rhombus pattern of the SeaFront paper, section 3.3.3."""

import math
from typing import Any

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import marker_prints
from fastgen.sampling.sheet import Sheet, between, tenth
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene import Decal, Vec2
from fastgen.validation import Range


def rhombus_offsets(count: int, width_mm: float, height_mm: float) -> list[Vec2]:
    """Return the marker centres of the two-row rhombus pattern (SeaFront paper, section 3.3.3).

    The paper lets i run from i_b = i_e - N to i_e = N / 2 + 1. It sets x_i = ceil(x + i w / 2);
    y_i is y for even i and y + h / 2 for odd i. The range has N + 1 values for N markers; this
    function skips the last. It follows the paper's text, not Algorithm A2, whose y_i ignores y.

    Args:
        count: Number of markers N.
        width_mm: Width w of a marker and its gap.
        height_mm: Height h of a marker and its gap.

    Returns:
        Offsets (x, y) from the pattern's anchor, mm.
    """
    last = count // 2 + 1
    return [
        (math.ceil(i * width_mm / 2), 0.0 if abs(i) % 2 == 0 else math.ceil(height_mm / 2))
        for i in range(last - count, last)
    ]


def sample_markers(config: MarkingsConfig, sheet: Sheet, streams: Streams) -> list[Decal]:
    """Sample the markers of a face; drop markers until the pattern fits.

    Args:
        config: Numbers, sizes and wear of markers.
        sheet: Sheet of the face.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Markers of the face, each with one of the prints of its class.
    """
    rng = streams(f"markers.{sheet.face}")
    low, high = config.markers_per_face
    count = int(rng.integers(low, high + 1))
    side = between(rng, config.marker_side_mm)
    gap = between(rng, config.marker_gap_mm)
    diagonal = tenth(side * math.sqrt(2))
    weights = config.marker_weights
    shares = np.array(list(weights.values())) / sum(weights.values())
    # equal weights draw integers, whose stream all datasets of the bundled markers share
    equal = len(set(weights.values())) == 1
    classes = rng.choice(list(weights), size=count, p=None if equal else shares)
    tilts = rng.uniform(*config.marker_tilt_deg, size=count)
    wears = rng.uniform(*config.marker_wear, size=count)
    print_rng = streams(f"marker_prints.{sheet.face}")
    prints = [_print(config, str(name), print_rng) for name in classes]
    while count > 0:
        # A square turned by t extends side / 2 * (cos t + sin t) toward its neighbour.
        tilt = math.radians(float(np.abs(tilts).max()))
        step = diagonal * (math.cos(tilt) + math.sin(tilt)) + math.sqrt(2) * gap
        offsets = np.array(rhombus_offsets(count, step, step))
        low_corner, high_corner = offsets.min(axis=0), offsets.max(axis=0)
        size = tuple(float(v) + diagonal * 1.01 for v in high_corner - low_corner)
        center = sheet.place((size[0], size[1]), rng, Range(0.0, 1.0), Range(0.0, 1.0))
        if center:
            shift = np.array(center) - (low_corner + high_corner) / 2
            return [
                Decal(
                    kind="marker",
                    class_name=str(classes[i]),
                    face=sheet.face,
                    center_mm=(tenth(x), tenth(y)),
                    size_mm=(diagonal, diagonal),
                    rotation_deg=round(float(tilts[i]), 2),
                    wear=round(float(wears[i]), 3),
                    **prints[i],
                )
                for i, (x, y) in enumerate(offsets + shift)
            ]
        count -= 1
    return []


def _print(config: MarkingsConfig, class_name: str, rng: np.random.Generator) -> dict[str, Any]:
    """Sample the appearance of one marker: artwork, tint, bleaching and torn corners."""
    own = class_name in config.markers and config.markers[class_name].art
    art = f"marker/{class_name}" if own else one_of(rng, marker_prints()[class_name])
    tint = rng.uniform(0.86, 0.98) + rng.uniform(-0.02, 0.02, 3)
    fade = rng.uniform(*config.marker_fade)
    # Corners that show the class digit are torn less often, or the class would be unknown.
    corners = rng.permutation(4)[: 1 + int(rng.random() < 0.25)]
    lost = rng.uniform(0.06, 0.3, 4) * (rng.random() < config.marker_torn)
    kept_digit = rng.random() < 0.8
    torn = [
        round(float(lost[i]), 3) if i in corners and not (i == 3 and kept_digit) else 0.0
        for i in range(4)
    ]
    return {
        "art": art,
        "tint": tuple(round(float(part), 3) for part in tint),
        "fade": round(float(fade), 3),
        "torn": tuple(torn),
    }
