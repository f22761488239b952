"""Presets: the values by which each differs from the defaults, which are those of the paper."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastgen import plugins


@dataclass(frozen=True)
class Preset:
    """A named configuration to start from.

    Packages offer their own as entry points of the group `fastgen.presets`.

    Attributes:
        about: What it shows, in one line.
        values: Values that differ from the defaults, nested as in a file. Paths of files are
            absolute.
    """

    about: str
    values: Mapping[str, Any]


DEFAULT_PRESET = "seafront"

_GROUP = "fastgen.presets"
"""Entry points by which packages offer presets."""

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

_FISHEYE = {"model": "fisheye", "k1": [-0.035, -0.005], "k2": [0.0, 0.006]}
_BARREL = {"k1": [-0.24, -0.16], "k2": [0.03, 0.07], "p1": [-1e-3, 1e-3]}
_SLIGHT = {"k1": [-0.14, -0.06], "p2": [-1e-3, 1e-3]}
"""Distortions, from short to long lenses."""

_LENSES = {
    "A": {"focal_mm": 22.0, "lens": _FISHEYE},
    "B": {"lens": _BARREL},
    "Cl": {"lens": _SLIGHT},
    "Cr": {"lens": _SLIGHT},
}

_OUTDOORS: dict[str, Any] = {
    "damage": {
        "kinds": ["axis", "concave", "dented", "perforation", "scrape"],
        "faces": ["front", "back", "door", "no_door", "roof"],
        # damages that no camera sees only cost time
        "toward_cameras": 1.0,
    },
    "surface": {
        "color_weights": _FLEET_PAINT,
        # as in photographs: paint is hardly bleached, and most rust is along edges
        "bleach": [0.0, 0.35],
        "rust_coverage": [0.0, 0.04],
    },
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
    "labels": {"background": "ignore"},
    "seals": {"probability": 0.7},
    "weather": {
        "fog_probability": 0.12,
        "rain_probability": 0.35,
        "rain_up_to_lx": 10_000.0,  # of the sunny panoramas, only one of a golden hour is darker
        "wet_probability": 0.1,
    },
}
"""Damage, paint and rust of fleets, labels, seals, weather and sensor effects, which the presets of
real cameras share."""

_UNPAVED = ("dawn", "forest", "forest_2", "night", "night_2", "park", "sky", "sunrise")
_HOURS = {
    **dict.fromkeys(("port_noon", "port_afternoon", "port_morning", "port_pier"), 3.0),
    **{"port_golden": 2.0, "port_overcast": 5.0, "city": 1.0, "city_2": 1.0, "venice": 1.0},
    **{"port_dusk": 1.0, "port_blue_hour": 1.0, "sunset": 0.5, "sunset_2": 0.5, "port_night": 2.0},
}
"""Weights of HDRIs by hours of work. Half of the scenes are in sunshine and 30 % under clouds; a
tenth are at dusk, and the rest at night. This is a choice; `fastgen fit` finds the weights of a
camera."""

_GATES = {
    **{"port_gate": 14.0, "port_gate_rain": 13.0, "port_gate_golden": 4.0},
    # in these, a ship is so close that its hull is seen below the horizon
    **{"port_overcast": 1.0, "port_noon": 1.0, "port_night": 1.0, "port_dusk": 0.5},
}
_YARDS = {
    "port_aisle": 9.0,
    "port_aisle_fog": 5.0,
    "port_aisle_night": 2.0,
    "port_rail": 6.0,
    "port_rail_rain": 4.0,
    "port_rail_dusk": 2.0,
}


def _on_ground(places: dict[str, float]) -> dict[str, Any]:
    """Return the same for presets with a ground, which must blend into that of the HDRI.

    Args:
        places: Weights of HDRIs that were taken where the containers stand.
    """
    environment = {
        **_OUTDOORS["environment"],
        "weights": {**_HOURS, **dict.fromkeys(_UNPAVED, 0.0), **places},
    }
    return {**_OUTDOORS, "environment": environment}


_GATE_END = {
    "focal_mm": 30.0,
    "distance_mm": [1900, 3800],
    "azimuth_deg": [-15, 15],
    "elevation_deg": [15, 42],
    "aim_up": [0.2, 1.0],
    "lens": _BARREL,
}
_GATE_SIDE = {
    "focal_mm": 28.0,
    "distance_mm": [2000, 4800],
    "azimuth_deg": [-60, 60],
    "elevation_deg": [-6, 26],
    "aim_right": [-0.95, 0.95],
    "aim_up": [-0.3, 0.9],
    "lens": _BARREL,
}
_YARD_POLE = {
    "focal_mm": 28.0,
    "azimuth_deg": [-50, 50],
    "elevation_deg": [15, 45],
    "target_shift_mm": [-1500, 1500],
    "lens": _SLIGHT,
}
_QUAY_SIDE = {
    "focal_mm": 22.0,
    "distance_mm": [5500, 14000],
    "azimuth_deg": [-40, 40],
    "elevation_deg": [10, 45],
    "aim_right": [-0.6, 0.6],
    "lens": _FISHEYE,
}
_QUAY_END = {
    "focal_mm": 32.0,
    "distance_mm": [4500, 9500],
    "azimuth_deg": [-30, 30],
    "elevation_deg": [8, 38],
    "lens": _SLIGHT,
}

PRESETS: dict[str, Preset] = {
    "seafront": Preset(
        "one container in the air, seen by the perfect cameras of the SeaFront paper", {}
    ),
    "crane": Preset(
        "the same with the cameras of a real crane: wide lenses, noise, weather, seals",
        {**_OUTDOORS, "cameras": _LENSES, "markings": {"marked_containers": 0.35}},
    ),
    "gate": Preset(
        "trailers in the lanes of a gate, seen from portals near by",
        {
            **_on_ground(_GATES),
            "markings": {"marked_containers": 0.15},
            "spreader": {"probability": 0.0},
            "placement": {
                "arrangements": {"trailer": 1.0, "twin": 0.5},
                "neighbours": [0, 3],
                "lifted_twins": 0.0,
                "islands": 0.6,
            },
            "ground": {
                "kinds": {"asphalt": 0.4, "concrete": 0.2, "paving": 0.4},
                "line_probability": 0.6,
                "line_spacing_mm": [3500, 4500],
                "reach_mm": [20000, 34000],
            },
            "cameras": {
                "rear": {"face": "door", **_GATE_END},
                "front": {"face": "no_door", **_GATE_END, "elevation_deg": [2, 38]},
                "left": {"face": "front", **_GATE_SIDE},
                "right": {"face": "back", **_GATE_SIDE},
                "roof": {
                    "face": "roof",
                    "focal_mm": 20.0,
                    "distance_mm": [2200, 4500],
                    "azimuth_deg": [-25, 25],
                    "elevation_deg": [-20, 20],
                    "aim_right": [-0.9, 0.9],
                    "lens": _FISHEYE,
                },
            },
        },
    ),
    "yard": Preset(
        "piles and rows on the ground, seen from a reach stacker, poles and a mast",
        {
            **_on_ground(_YARDS),
            "markings": {"marked_containers": 0.1},
            "spreader": {"probability": 0.0},
            "placement": {
                "arrangements": {"stack": 0.75, "row": 0.25},
                "neighbours": [3, 11],
                "tiers": [2, 4],
            },
            "ground": {"line_probability": 0.7, "line_spacing_mm": [2700, 3300]},
            "cameras": {
                "stacker": {
                    "face": "front",
                    "focal_mm": 22.0,
                    "distance_mm": [4000, 9000],
                    "azimuth_deg": [-35, 35],
                    "elevation_deg": [-5, 25],
                    "aim_right": [-0.5, 0.5],
                    "lens": _FISHEYE,
                },
                "pole_door": {"face": "door", "distance_mm": [7000, 18000], **_YARD_POLE},
                "pole_end": {"face": "no_door", "distance_mm": [7000, 18000], **_YARD_POLE},
                "mast": {
                    "face": "front",
                    "focal_mm": 35.0,
                    "distance_mm": [12000, 30000],
                    "azimuth_deg": [-50, 50],
                    "elevation_deg": [20, 45],
                    "target_shift_mm": [-3000, 3000],
                },
            },
        },
    ),
    "quay": Preset(
        "containers under a ship-to-shore crane: in the air, on trailers, on the quay",
        {
            **_on_ground({}),
            "markings": {"marked_containers": 0.35},
            "spreader": {"probability": 0.6},
            "placement": {
                "arrangements": {
                    "lifted": 0.4,
                    "trailer": 0.3,
                    "stack": 0.1,
                    "standing": 0.1,
                    "twin": 0.5,
                },
                "neighbours": [0, 4],
                "tiers": [1, 2],
                "lifted_twins": 0.5,
            },
            "ground": {"kinds": {"asphalt": 0.3, "concrete": 0.5, "paving": 0.2}},
            "cameras": {
                "waterside": {"face": "front", **_QUAY_SIDE},
                "landside": {"face": "back", **_QUAY_SIDE},
                "end_left": {"face": "no_door", **_QUAY_END},
                "end_right": {"face": "door", **_QUAY_END},
            },
        },
    ),
}
"""The presets of fastgen itself. `examples/ports/` explains the values of ports."""


def preset_names() -> list[str]:
    """Return the names of all presets, those of fastgen first."""
    return list(dict.fromkeys((*PRESETS, *plugins.names(_GROUP))))


def preset_named(name: str) -> Preset:
    """Return a preset of fastgen or of an installed package.

    Raises:
        ConfigError: The name is unknown, or the package that offers the preset is broken.
    """
    return plugins.chosen("preset", name, PRESETS, _GROUP, Preset)
