"""Preparation of everything that scenes of a generator may need, ahead of a long run."""

import logging
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from dataclasses import replace
from typing import Protocol

from fastgen.config.config import Config
from fastgen.config.lamps import LampsConfig
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.renderer import Renderer
from fastgen.render.session import GpuSession
from fastgen.sampling.coverage import damage_variant_configs, possible_shapes
from fastgen.sampling.scene import environment_weights, sample_scene
from fastgen.scene import Camera, EnvironmentView, Scene
from fastgen.scene.optics import Lamp

_log = logging.getLogger(__name__)


class SceneRenderer(Protocol):
    """The members of a Generator that preloading uses."""

    config: Config
    seed: int
    gpu: GpuSession

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of images in pixels."""

    @property
    def environments(self) -> dict[str, float]:
        """Weight of each HDRI by name."""

    def container_map(self, environment: str) -> object:
        """Return the containers that an environment shows."""

    def scene(self, index: int) -> Scene:
        """Return a sampled scene."""

    def render(self, *, camera: Camera, scene: Scene) -> object:
        """Render and label one image."""


def preload(generator: SceneRenderer, on_step: Callable[[], None]) -> None:
    """Prepare every light, shape and program that scenes of a generator may need.

    Afterwards neither the time nor the memory of a render grows.

    Args:
        generator: The generator.
        on_step: Called before each step; a step takes seconds if the disk cache is empty.
    """
    config = generator.config
    weights = environment_weights(config, generator.environments)
    environments = [name for name, weight in weights.items() if weight > 0]
    scene = generator.scene(0)
    lens = any(camera.lens is not None for camera in scene.cameras)
    with generator.gpu.drawing() as renderer:
        for number, name in enumerate(environments, start=1):
            on_step()
            _log.info("loading light %d of %d", number, len(environments))
            renderer.preload_environment(name)
            generator.container_map(name)
        shapes = list(possible_shapes(config))
        for number, (container, spreader) in enumerate(shapes, start=1):
            on_step()
            _log.info("loading shape %d of %d", number, len(shapes))
            shape = replace(scene, container=container, spreader=spreader, damages=())
            renderer.preload(PreparedScene(shape), lens, config.damage.probability > 0)
        draws = _distinct_draws(renderer, _typical_scenes(generator, environments), generator.size)
    for number, (shown, camera) in enumerate(draws, start=1):
        on_step()
        _log.info("compiling shaders, %d of %d", number, len(draws))
        generator.render(scene=shown, camera=camera)


def _typical_scenes(generator: SceneRenderer, environments: Collection[str]) -> Iterator[Scene]:
    """Yield a scene of each damage variant, in each of the environments."""
    for config in damage_variant_configs(generator.config):
        scene = sample_scene(config, generator.seed, 0, generator.environments)
        for name in environments:
            for count in _lamp_counts(config.environment.lamps):
                lamps = (Lamp(0.0, 45.0, 100.0),) * count
                yield replace(scene, environment=EnvironmentView(name, 0.0, lamps=lamps))


def _lamp_counts(config: LampsConfig) -> range:
    """Return the possible numbers of lamps; they decide the number of lights of a program."""
    return range(config.count[1] + 1 if config.probability > 0 else 1)


def _distinct_draws(
    renderer: Renderer, scenes: Iterable[Scene], size: tuple[int, int]
) -> list[tuple[Scene, Camera]]:
    """Return one scene and camera for each set of programs that draws need."""
    draws: dict[Hashable, tuple[Scene, Camera]] = {}
    for scene in scenes:
        prepared = PreparedScene(scene)
        for camera in scene.cameras:
            draws.setdefault(renderer.programs_key(prepared, camera, size), (scene, camera))
    return list(draws.values())
