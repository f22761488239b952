"""Picture of one scene with each part of the sensor model and each weather: docs/sensor_parts.jpg.

python examples/sensor_parts.py docs/sensor_parts.jpg
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from fastgen import Config, Generator
from fastgen.camera.electronics import stamped
from fastgen.files.images import jpeg, write
from fastgen.scene import Camera, Scene
from fastgen.scene.optics import (
    ChromaNoise,
    Defocus,
    Lens,
    Meter,
    Noise,
    Rain,
    Response,
    Sensor,
    Sharpening,
    Stamp,
    Weather,
)

SIZE = (320, 240)
INDEX = 3

SENSORS = {
    "defocus": Sensor(defocus=Defocus(1500, 1.4)),
    "motion": Sensor(motion=(0.02, 0.006)),
    "vignetting": Sensor(vignetting=0.7),
    "exposure +1.5 EV": Sensor(exposure_error_ev=1.5),
    "white balance": Sensor(gains=(1.25, 1.0, 0.75)),
    "noise": Sensor(noise=Noise(400, 6, 1)),
    "response": Sensor(response=Response(1.2, 1.1, 1.2)),
    "contrast 1.6": Sensor(response=Response(1.2, 1.6, 1.0)),
    "chroma noise": Sensor(chroma_noise=ChromaNoise(0.025, 5.0, 1)),
    "sharpening": Sensor(sharpening=Sharpening(1.5, 1.2)),
    "JPEG 15": Sensor(jpeg_quality=15),
    "stamp": Sensor(stamp=Stamp("2024-11-21 06:41:08", "top left", 0.04)),
}

DIM = Sensor(
    meter=Meter(f_number=2.0, longest_s=0.03, largest_iso=3200, dim_target=0.06),
    noise=Noise(6000, 4, 1),
    response=Response(1.2, 1.1, 1.2),
)
"""A camera at the limits of its meter."""

LENSES = {
    "no lens": (None, 16.0),
    "Brown-Conrady": (Lens("brown_conrady", (-0.22, 0.07, 0.0, 0.0, -0.008)), 18.0),
    "fisheye": (Lens("fisheye", (-0.02, 0.003, -0.001, 0.0)), 18.0),
}

WEATHERS = {
    "fog, 25 m": Weather(visibility_mm=25e3),
    "rain, 80 mm/h": Weather(rain=Rain(80, 0.002, 0.2, 5)),
    "wet": Weather(wetness=1.0),
}


def tiles(generator: Generator, scene: Scene, camera: Camera) -> list[np.ndarray]:
    """Return an image [H, W, 3] for each part, with its name in the lower left corner."""
    found = []
    for name, (lens, focal_mm) in LENSES.items():
        found.append((name, scene, replace(camera, lens=lens, focal_mm=focal_mm)))
    for name, sensor in SENSORS.items():
        found.append((name, scene, replace(camera, sensor=sensor)))
    for name, weather in WEATHERS.items():
        found.append((name, replace(scene, weather=weather), camera))
    dim = replace(scene, environment=replace(scene.environment, illuminance_lx=10.0))
    found.append(("meter, 10 lx", dim, replace(camera, sensor=DIM)))
    crane = Generator(Config.preset("crane"), seed=1, size=SIZE).scene(3)
    found.append(("preset crane", crane, crane.camera("A")))
    images = []
    for name, shown, seen_by in found:
        image = generator.render(scene=shown, camera=seen_by).image
        images.append(stamped(image, Stamp(name, "bottom left", 0.05)))
    return images


def main() -> None:
    """Write the picture with five tiles per row."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="JPEG file to write")
    path = parser.parse_args().out
    with Generator(Config.preset(), seed=7, size=SIZE) as generator:
        scene = generator.scene(INDEX)
        camera = replace(scene.camera("A"), focal_mm=16.0)
        images = tiles(generator, scene, camera)
    rows = [np.concatenate(images[i : i + 5], axis=1) for i in range(0, len(images), 5)]
    write(path, jpeg(np.concatenate(rows)))


if __name__ == "__main__":
    main()
