"""Frame -> the Frame that a real camera would have given: weather, optics, sensor, encoder.

In the order of the real thing: fog and rain, defocus and motion, fall-off, exposure, noise, white
balance, all in linear light; then the tone curve, the stamp and JPEG. The image changes,
labels are those of what is there, at the middle of the exposure.
"""

from dataclasses import replace

import cv2
import numpy as np

from fastgen.camera.blur import blur_radius_px, defocused, moved
from fastgen.camera.electronics import falloff, noisy, stamped, through_jpeg
from fastgen.camera.projection import View
from fastgen.camera.tone_curve import Light, displayed, light_of
from fastgen.camera.weather import foggy, rained
from fastgen.frame import Frame
from fastgen.scene import Camera, Color
from fastgen.scene.optics import Sensor, Weather


def is_needed(camera: Camera, weather: Weather) -> bool:
    """Whether `develop` changes anything."""
    return camera.sensor is not None or bool(weather.visibility_mm or weather.rain)


def develop(frame: Frame, view: View, camera: Camera, weather: Weather, airlight: Color) -> Frame:
    """The frame as `camera` records it in `weather`.

    airlight: mean light of the sky in the frame's exposure: that of fog, and of drops.
    """
    sensor = camera.sensor or Sensor()
    encoding = replace(Sensor(), stamp=sensor.stamp, jpeg_quality=sensor.jpeg_quality)
    image = frame.image
    if sensor != encoding or is_needed(replace(camera, sensor=None), weather):
        light = _weathered(light_of(image), frame, view, weather, np.array(airlight, np.float32))
        image = displayed(_exposed(light, frame, view, camera, sensor))
    if sensor.stamp:
        image = stamped(image, sensor.stamp)
    if sensor.jpeg_quality:
        image = through_jpeg(image, sensor.jpeg_quality)
    return replace(frame, image=image)


def _weathered(light: Light, frame: Frame, view: View, weather: Weather, sky: Light) -> Light:
    if weather.visibility_mm:
        away = _ray_m(frame, view)
        light = foggy(light, away, frame.cover, weather.visibility_mm, sky)
    if weather.rain:
        light = rained(light, frame.depth, view, weather.rain, sky)
    return light


def _exposed(light: Light, frame: Frame, view: View, camera: Camera, sensor: Sensor) -> Light:
    width, _ = view.size
    if sensor.defocus:
        light = defocused(light, blur_radius_px(sensor.defocus, camera, width, frame.depth))
    right, down = sensor.motion
    light = moved(light, (right * width, down * width))
    if sensor.vignetting:
        light = light * falloff(view.size, sensor.vignetting)
    if sensor.exposure_error_ev:
        light = light * np.float32(2.0**sensor.exposure_error_ev)
    if sensor.noise:
        light = noisy(light, sensor.noise)
    if sensor.gains != (1, 1, 1):
        planes = zip(cv2.split(light), sensor.gains, strict=True)
        light = np.asarray(cv2.merge([plane * np.float32(gain) for plane, gain in planes]))
    return light


def _ray_m(frame: Frame, view: View) -> np.ndarray:
    """Distance along each pixel's ray, float32 [H, W]."""
    if view.distortion:
        _, rays = view.rays()
        return np.asarray(frame.depth / (rays @ view.rotation[2]), np.float32)
    (width, height), (x, y) = view.size, view.center_px
    across = (np.arange(width, dtype=np.float32) + 0.5 - x) / view.focal_px
    down = (np.arange(height, dtype=np.float32) + 0.5 - y) / view.focal_px
    return np.asarray(frame.depth * np.sqrt(1 + across**2 + down[:, None] ** 2), np.float32)
