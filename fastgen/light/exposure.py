"""Exposure metering weighted to the container in the centre of the image, and light of fog."""

import numpy as np

from fastgen.camera.exposure import MIDDLE_GREY, Exposure, limited_exposure
from fastgen.camera.projection import View
from fastgen.light.environment import Ambient, irradiance_at, metered_luminance
from fastgen.scene import REC_709, Camera, Color

_CENTER_WEIGHT = 0.65
_MIN_LUMINANCE = 1e-6

_BRIGHTEST_AIR = 0.65
"""Largest exposed radiance of fog: a light meter keeps fog below the tone curve's shoulder."""


def metered_exposure(
    light: Ambient,
    cd_m2: float,
    yaw_deg: float,
    view: View,
    camera: Camera,
    paint: Color,
    ground: Color | None = None,
) -> Exposure:
    """Return the exposure that brings the metered mean to MIDDLE_GREY, or to a meter's target.

    The metered mean is geometric: 65 % the container, 35 % the background in view. The container
    is taken as a plane that faces the camera squarely in azimuth: upright, or level if the camera
    looks up or down by more than 45 degrees. Its reflectance is the geometric mean of its paint and
    MIDDLE_GREY, because a metering pattern averages over other surfaces as well. For a
    camera with `sensor.meter`, the share of the view's width that is below the horizon shows the
    ground of the scene, lit by the whole environment.

    Args:
        light: Light of the environment and of lamps.
        cd_m2: Luminance of a unit of radiance, see lamps.unit_luminance.
        yaw_deg: Counter-clockwise rotation of the environment about the vertical, seen from above.
        view: Projection of the camera.
        camera: Its `exposure_ev` is added in stops. The meter of its sensor limits the exposure.
        paint: Linear albedo of the container.
        ground: Mean linear albedo of the ground, if the scene has one.
    """
    forward = view.rotation[2]
    level, upright = np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    steep = abs(forward[2]) > np.linalg.norm(forward * level)
    toward_camera = -forward * (upright if steep else level)
    toward_camera /= np.linalg.norm(toward_camera)
    falling = float(irradiance_at(light, toward_camera[None], yaw_deg)[0] @ REC_709)
    reflectance = float(np.sqrt(MIDDLE_GREY * max(float(np.array(paint) @ REC_709), 0.02)))
    behind = metered_luminance(light, forward, view.half_angle_deg, yaw_deg)
    center = max(reflectance * falling, _MIN_LUMINANCE)
    behind = max(behind, _MIN_LUMINANCE)
    meter = camera.sensor.meter if camera.sensor else None
    if meter and ground:
        open_light = float(irradiance_at(light, upright[None], yaw_deg)[0] @ REC_709)
        paved = max(float(np.array(ground) @ REC_709) * open_light, _MIN_LUMINANCE)
        rise_deg = np.rad2deg(np.arcsin(np.clip(forward[2], -1, 1)))
        below = np.clip(0.5 - 0.5 * rise_deg / view.half_angle_deg, 0, 1)
        behind = float(paved**below * behind ** (1 - below))
    metered = np.exp(_CENTER_WEIGHT * np.log(center) + (1 - _CENTER_WEIGHT) * np.log(behind))
    if meter is None:
        return Exposure(float(MIDDLE_GREY / metered * 2.0**camera.exposure_ev))
    return limited_exposure(float(metered), cd_m2, meter, camera.exposure_ev)


def airlight(light: Ambient, yaw_deg: float, exposure: float) -> Color:
    """Return the exposed radiance of fog and rain: the mean of the light from all around.

    Args:
        light: Light of the environment.
        yaw_deg: Rotation of the environment.
        exposure: Factor on radiance.
    """
    around = [[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    mean = irradiance_at(light, around, yaw_deg).mean(axis=0)
    mean = mean * exposure
    red, green, blue = (mean * min(1.0, _BRIGHTEST_AIR / float(mean.max()))).tolist()
    return red, green, blue
