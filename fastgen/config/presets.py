"""Presets: the values by which each differs from the defaults, which are those of the paper."""

from typing import Any

_FLEET_PAINT = {
    "oxide red": 22,
    "maroon": 16,
    "rust brown": 12,
    "signal blue": 9,
    "navy": 7,
    "sky blue": 4,
    "turquoise": 2,
    "sea green": 3,
    "leaf green": 2,
    "olive": 0.5,
    "traffic orange": 4,
    "amber": 1,
    "cream": 1,
    "light grey": 5,
    "mid grey": 4,
    "white": 5,
    "magenta": 1.5,
    "charcoal": 1,
}
"""Frequency of paints in fleets, in percent: half are red, maroon or brown, a fifth blue."""

_LENSES = {
    "A": {
        "focal_mm": 22.0,
        "lens": {"model": "fisheye", "k1": [-0.035, -0.005], "k2": [0.0, 0.006]},
    },
    "B": {"lens": {"k1": [-0.24, -0.16], "k2": [0.03, 0.07], "p1": [-1e-3, 1e-3]}},
    "Cl": {"lens": {"k1": [-0.14, -0.06], "p2": [-1e-3, 1e-3]}},
    "Cr": {"lens": {"k1": [-0.14, -0.06], "p2": [-1e-3, 1e-3]}},
}

_OUTDOORS: dict[str, Any] = {
    "surface": {"color_weights": _FLEET_PAINT},
    "cameras": _LENSES,
    "sensor": {
        "defocus": {"probability": 0.15},
        "motion": {"probability": 0.5},
        "meter": {"probability": 1.0},
        "vignetting": [0.0, 0.5],
        "exposure_error_ev": [-0.7, 0.7],
        "white_balance_ev": [-0.15, 0.15],
        "noise": {"probability": 0.9},
        "response": {"probability": 1.0},
        "chroma_noise": {"probability": 0.7},
        "sharpening": {"probability": 0.8},
        "stamp": {"probability": 0.3},
        "jpeg_quality": [45, 92],
    },
    "environment": {"lamps": {"probability": 0.6}},
    "seals": {"probability": 0.7},
    "weather": {"fog_probability": 0.12, "rain_probability": 0.15, "wet_probability": 0.1},
}
"""Fleets, seals, wide lenses, weather and sensor effects that all presets of real cameras share."""

PRESETS: dict[str, dict[str, Any]] = {
    "seafront": {},
    # images of real crane cameras
    "crane": {**_OUTDOORS, "markings": {"marked_containers": 0.35}},
    # containers that pass a gate: most without markers, none on a spreader
    "gate": {
        **_OUTDOORS,
        "markings": {"marked_containers": 0.15},
        "spreader": {"probability": 0.0},
    },
}
"""Values of each preset, nested as in a file."""
