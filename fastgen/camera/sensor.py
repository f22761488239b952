"""The camera model: linear light to the image that a real camera would deliver.

Order of the effects: fog and rain, defocus, motion blur, vignetting, exposure error, noise and
white balance, all in linear light; then the tone or response curve, chroma noise, sharpening,
stamp and JPEG. Only the image changes. Labels describe the sharp scene at the middle of the
exposure.
"""

from dataclasses import replace
from functools import lru_cache
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.blur import blur_radius_px, defocused, motion_blurred
from fastgen.camera.electronics import (
    compress_jpeg,
    noisy,
    sharpened,
    stamped,
    vignette,
    with_chroma_noise,
)
from fastgen.camera.exposure import Exposure
from fastgen.camera.projection import View
from fastgen.camera.response import respond
from fastgen.camera.tone_curve import Light, tone_map_and_encode
from fastgen.camera.weather import BACKDROP_M, add_fog, add_rain
from fastgen.frame import Frame
from fastgen.scene import Camera, Color, Ground
from fastgen.scene.limits import MM
from fastgen.scene.optics import Rain, Sensor, Weather

_UNMETERED = Exposure(1.0)

_METER_STEP = 8
"""Distance in pixels between the pixels in which a meter looks for highlights."""

_BAND_ROWS = 32
"""Number of rows that are recorded at once, so that they stay in the processor's cache."""

_NODE_PX = 8
"""Distance in pixels between the pixels whose rays are computed; others are interpolated. Without
lens distortion, with a focal length of f pixels, ray lengths are wrong by up to 16 / f^2 of their
value, which is 5e-5 at 554 pixels. Distances of ground near the horizon have larger errors."""


def is_needed(camera: Camera, weather: Weather) -> bool:
    """Return whether the camera model changes the image."""
    return camera.sensor is not None or _has_fog_or_rain(weather)


def needs_radiance(camera: Camera, weather: Weather) -> bool:
    """Return whether the camera model works on linear light, not only on the encoded image."""
    sensor = camera.sensor or Sensor()
    linear = replace(sensor, chroma_noise=None, sharpening=None, stamp=None, jpeg_quality=0)
    return linear != Sensor() or _has_fog_or_rain(weather)


def apply_camera_model(
    frame: Frame,
    view: View,
    camera: Camera,
    weather: Weather,
    airlight: Color,
    exposure: Exposure = _UNMETERED,
    ground: Ground | None = None,
) -> NDArray[np.uint8]:
    """Return the image that a camera records of a rendered frame.

    Args:
        frame: The ideal image. `frame.radiance` is required if `needs_radiance`.
        view: Projection of `camera` at the size of the frame.
        camera: Its `sensor` holds the parameters of the model.
        weather: Fog and rain between the camera and the scene.
        airlight: Mean linear light of the sky in the exposure of the frame: colour of fog and rain.
        exposure: Exposure of the frame, for cameras with a meter.
        ground: The scene's ground; fog continues it in the HDRI.

    Returns:
        uint8 [H, W, 3], sRGB.
    """
    sensor = camera.sensor or Sensor()
    image = frame.image
    if needs_radiance(camera, weather):
        assert frame.radiance is not None, "render with radiance=True"
        sky = np.array(airlight, np.float32)
        seen = replace(weather, rain=weather.rain and _rain_of(weather.rain, camera, exposure))
        light = _through_weather(frame, view, seen, sky, ground)
        if sensor.meter:
            times = _for_highlights(light, sensor)
            if times < 1:
                light, exposure = light * np.float32(times), exposure.lowered(times)
        image = _developed(_blurred(light, frame, camera, exposure), sensor, exposure.gain)
    if sensor.chroma_noise:
        image = with_chroma_noise(image, sensor.chroma_noise, exposure.gain)
    if sensor.sharpening:
        image = sharpened(image, sensor.sharpening)
    if sensor.stamp:
        image = stamped(image, sensor.stamp)
    if sensor.jpeg_quality:
        image = compress_jpeg(image, sensor.jpeg_quality)
    return image


def _rain_of(rain: Rain, camera: Camera, exposure: Exposure) -> Rain:
    """Return the rain in a camera's image: drops of its own.

    A meter's shutter time is that before highlights lower it, because rain may be a highlight.
    """
    own = np.random.SeedSequence((rain.seed, crc32(camera.name.encode()))).generate_state(1)
    return replace(rain, seed=int(own[0]), shutter_s=exposure.shutter_s or rain.shutter_s)


def _has_fog_or_rain(weather: Weather) -> bool:
    return bool(weather.visibility_mm or weather.rain)


def _through_weather(
    frame: Frame, view: View, weather: Weather, sky: Light, ground: Ground | None
) -> Light:
    light = frame.radiance
    assert light is not None
    if weather.visibility_mm:
        stretch, backdrop_m = along_rays(view, ground)
        ray_m = frame.depth * stretch
        light = add_fog(light, ray_m, frame.cover, weather.visibility_mm, sky, backdrop_m)
    if weather.rain:
        light = add_rain(light, frame.depth, view, weather.rain, sky)
    return light


def _for_highlights(light: Light, sensor: Sensor) -> float:
    """Return the factor, 0.5 to 1, by which a meter lowers the exposure to protect highlights."""
    assert sensor.meter is not None
    some = light[::_METER_STEP, ::_METER_STEP].max(axis=2).ravel()
    clipped = min(int(sensor.meter.highlights * some.size), some.size - 1)
    brightest = np.partition(some, some.size - 1 - clipped)[some.size - 1 - clipped]
    white = sensor.response.clip if sensor.response else 1.0
    return min(max(white / max(float(brightest), white), 0.5), 1.0)


def _blurred(light: Light, frame: Frame, camera: Camera, exposure: Exposure) -> Light:
    sensor, width = camera.sensor or Sensor(), light.shape[1]
    if sensor.defocus:
        light = defocused(light, blur_radius_px(sensor.defocus, camera, width, frame.depth))
    right, down = (
        moved + exposure.shutter_s * speed
        for moved, speed in zip(sensor.motion, sensor.speed, strict=True)
    )
    return motion_blurred(light, (right * width, down * width))


def _developed(light: Light, sensor: Sensor, gain: float) -> NDArray[np.uint8]:
    """Return the encoded image after vignetting, noise, gains and tone curve.

    These treat each pixel independently.

    Args:
        light: float32 [H, W, 3], blurred linear light.
        sensor: Parameters of the sensor.
        gain: Sensor gain, 1 at base ISO.

    Returns:
        uint8 [H, W, 3], sRGB.
    """
    height, width = light.shape[:2]
    times = np.float32(2.0**sensor.exposure_error_ev)
    factor = np.full((height, width), times)
    if sensor.vignetting:
        factor *= vignette((width, height), sensor.vignetting)[..., 0]
    raw = np.random.SFC64(sensor.noise.seed) if sensor.noise else None
    gains = np.diag(sensor.gains).astype(np.float32)
    image = np.empty(light.shape, np.uint8)
    for top in range(0, height, _BAND_ROWS):
        rows = slice(top, top + _BAND_ROWS)
        part = light[rows] * cv2.merge([factor[rows]] * 3)  # NumPy is slow along short axes
        if sensor.noise:
            part = noisy(part, sensor.noise, gain, raw)
        if sensor.gains != (1, 1, 1):
            part = np.asarray(cv2.transform(part, gains))
        curve = sensor.response
        image[rows] = respond(part, curve) if curve else tone_map_and_encode(part)
    return image


@lru_cache(maxsize=1)  # the camera model and the labels of an image in fog need the same
def along_rays(
    view: View, ground: Ground | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the ray length per unit of depth and the distance of the background, by pixel.

    Both are interpolated between pixels _NODE_PX apart.

    Args:
        view: Projection of the camera.
        ground: The ground. Without one the background is at BACKDROP_M.

    Returns:
        float32 [H, W] each. The distance is along the ray in metres, at most BACKDROP_M.
    """
    nodes = [(np.arange(-(-side // _NODE_PX) + 2) - 0.5) * _NODE_PX for side in view.size]
    eye_mm, rays = view.rays(np.stack(np.meshgrid(*nodes), axis=-1))
    width, height = view.size
    inside = slice(_NODE_PX, _NODE_PX + height), slice(_NODE_PX, _NODE_PX + width)

    def at_pixels(smooth: NDArray[np.float64]) -> NDArray[np.float32]:
        fine = cv2.resize(smooth.astype(np.float32), None, fx=_NODE_PX, fy=_NODE_PX)
        return np.asarray(fine[inside], np.float32)

    stretch = at_pixels(1 / (rays @ view.rotation[2]))
    if ground is None:
        return stretch, np.full_like(stretch, BACKDROP_M)
    above_m = max(float(eye_mm[2] - ground.height_mm) * MM, 1e-3)
    falling = np.maximum(at_pixels(-rays[..., 2]), np.float32(above_m / BACKDROP_M))
    return stretch, np.asarray(above_m / falling, np.float32)
