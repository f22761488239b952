"""Floodlights of a scene, added to the directional lights of its environment."""

from dataclasses import replace

import numpy as np

from fastgen.light.directional_lights import MAX_LIGHTS, DirectionalLight
from fastgen.light.environment import Ambient, irradiance_at, to_map_frame
from fastgen.scene import REC_709, EnvironmentView

_RADIUS = np.deg2rad(1.0)
"""Angular radius of a floodlight, which softens its highlights and shadows."""

_LEAST_LUMINANCE = 1e-6


def unit_luminance(light: Ambient, illuminance_lx: float) -> float:
    """Return the luminance in cd/m2 of a unit of radiance.

    Args:
        light: The environment without lamps.
        illuminance_lx: Its light on level ground.
    """
    up = float(irradiance_at(light, [[0, 0, 1]])[0] @ REC_709)
    return illuminance_lx / (np.pi * max(up, _LEAST_LUMINANCE))


def with_lamps(light: Ambient, environment: EnvironmentView, cd_m2: float) -> Ambient:
    """Return the light of an environment and of its lamps; `light` itself if it has no lamps.

    The weakest directional lights give way, because MAX_LIGHTS is the most that cast shadows.

    Args:
        light: The environment without lamps.
        environment: Its lamps and rotation.
        cd_m2: Luminance of a unit of radiance.
    """
    if not environment.lamps:
        return light
    added = []
    for lamp in environment.lamps:
        azimuth, elevation = np.deg2rad((lamp.azimuth_deg, lamp.elevation_deg))
        level = np.cos(elevation)
        toward = (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation))
        x, y, z = to_map_frame(toward, environment.yaw_deg).tolist()
        color = np.array(lamp.color)
        # a surface that faces the lamp and reflects all light has the luminance E / pi
        r, g, b = (color / (color @ REC_709) * lamp.illuminance_lx / np.pi / cd_m2).tolist()
        added.append(DirectionalLight((x, y, z), (r, g, b), float(_RADIUS)))
    lights = sorted((*light.lights, *added), key=lambda each: -float(np.dot(each.light, REC_709)))
    return replace(light, lights=tuple(lights[:MAX_LIGHTS]))
