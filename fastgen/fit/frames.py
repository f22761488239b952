"""Linear light of rendered scenes, kept so that many cameras can be tried on it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.exposure import Exposure
from fastgen.camera.projection import View, view_of
from fastgen.camera.sensor import apply_camera_model
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.config.config import Config
from fastgen.config.sensor import SensorConfig
from fastgen.fit.statistics import Pixels, measured
from fastgen.frame import Frame
from fastgen.generator import Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.exposure import airlight
from fastgen.light.hdri import hours_of, kind_of
from fastgen.sampling.scene import environment_weights, sample_scene
from fastgen.sampling.sensor import sample_moment, sample_sensor
from fastgen.sampling.streams import stream
from fastgen.scene import Camera, Color, Scene

LIGHTS = {
    "night": "night",
    "dusk": "twilight",
    "sunset": "twilight",
    "dawn": "twilight",
    "overcast": "overcast",
    "day": "sun",
}
"""Class of light of the kinds of environments."""

_OTHER = "other"


@dataclass(frozen=True, eq=False)
class LinearFrame:
    """A rendered frame before its camera's sensor.

    Attributes:
        frame: With `radiance`, and as `image` that of a camera without sensor effects.
        view: Projection of the camera.
        camera: Camera of the scene.
        scene: The scene.
        air: Light of fog and rain.
        exposure: Exposure of the frame.
        moment: Date and time of the scene.
        light: Class of the scene's light, a value of LIGHTS or "other".
    """

    frame: Frame
    view: View
    camera: Camera
    scene: Scene
    air: Color
    exposure: Exposure
    moment: datetime
    light: str

    def picture(self, sensor: SensorConfig) -> Pixels:
        """Return the picture of a camera with a sensor drawn from a configuration.

        All configurations draw from the same random numbers, so that pictures of similar
        configurations are similar. The meter must be that of the rendered scene.
        """
        place = np.subtract(self.camera.position_mm, self.camera.target_mm)
        drawn = sample_sensor(
            sensor,
            float(np.linalg.norm(place)),
            self.moment,
            lambda part: stream(
                self.scene.seed, self.scene.index, f"sensor.{self.camera.name}.{part}"
            ),
        )
        camera = replace(self.camera, sensor=drawn)
        scene = self.scene
        return apply_camera_model(
            self.frame, self.view, camera, scene.weather, self.air, self.exposure, scene.ground
        )


def light_class(environment: str) -> str:
    """Return the class of an environment's light; "other" for interiors and files of users."""
    return LIGHTS.get(kind_of(environment), _OTHER)


def light_shares(config: Config, available: Mapping[str, float]) -> dict[str, float]:
    """Return the share of scenes in each class of light."""
    weights = environment_weights(config, available)
    shares: dict[str, float] = {}
    for name, weight in weights.items():
        if weight > 0:
            shares[light_class(name)] = shares.get(light_class(name), 0) + weight
    total = sum(shares.values())
    return {light: share / total for light, share in sorted(shares.items())}


def linear_frames(generator: Generator, count: int, first: int = 0) -> Iterator[LinearFrame]:
    """Yield the linear light of rendered scenes, equally many in each class of light.

    Args:
        generator: Its configuration, seed and size are those of the frames.
        count: Number of frames; cameras and classes of light take turns.
        first: Index of the first scene.
    """
    config = generator.config
    shares = light_shares(config, generator.environments)
    weights = environment_weights(config, generator.environments)
    for k in range(count):
        light = list(shares)[k % len(shares)]
        only = {name: own if light_class(name) == light else 0.0 for name, own in weights.items()}
        environment = replace(config.environment, weights=only)
        one_light = replace(config, environment=environment)
        scene = sample_scene(one_light, generator.seed, first + k, generator.environments)
        cameras = scene.cameras
        # each camera meets each light, also if their numbers have a common factor
        camera = cameras[(k + k // math.lcm(len(shares), len(cameras))) % len(cameras)]
        yield _linear_frame(generator, scene, camera, light)


def _linear_frame(generator: Generator, scene: Scene, camera: Camera, light: str) -> LinearFrame:
    config = generator.config
    with generator.gpu.drawing() as renderer:
        frame = renderer.render(PreparedScene(scene), camera, generator.size, radiance=True)
        exposure = renderer.exposure(scene, camera, generator.size)
        ambient = renderer.ambient(scene)
        air = airlight(ambient, scene.environment.yaw_deg, exposure.factor)
    assert frame.radiance is not None
    moment = sample_moment(
        config.sensor.stamp.years,
        hours_of(scene.environment.name),
        stream(scene.seed, scene.index, "moment"),
    )
    return LinearFrame(
        replace(frame, image=tone_map_and_encode(frame.radiance)),
        view_of(camera, generator.size),
        camera,
        scene,
        air,
        exposure,
        moment,
        light,
    )


def statistics_of_frames(
    frames: Sequence[LinearFrame], sensor: SensorConfig, workers: Executor
) -> NDArray[np.float64]:
    """Return the statistics [N, len(NAMES)] of the pictures that a sensor makes of frames."""
    return np.array(list(workers.map(lambda each: measured(each.picture(sensor)), frames)))
