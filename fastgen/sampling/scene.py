"""Sampling of a scene from (config, seed, index), with the same result on every machine.

Each property has its own random stream, named after the property. New properties and additional
draws therefore leave all other properties of a scene unchanged.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from functools import partial

import numpy as np

from fastgen.camera.projection import view_of
from fastgen.config.cameras import CameraConfig, direction_from, face_frame
from fastgen.config.config import Config, SpreaderConfig
from fastgen.config.fields import linear_color
from fastgen.errors import ConfigError, nearest
from fastgen.light.hdri import hours_of, illuminance_of
from fastgen.sampling.contents import of_neighbours, sample_contents
from fastgen.sampling.damage import listed_kinds, within_limit
from fastgen.sampling.lamps import sample_lamps
from fastgen.sampling.neighbours import (
    Surroundings,
    sample_ground,
    sample_neighbours,
    sample_surroundings,
    streams_of,
)
from fastgen.sampling.sensor import sample_lens, sample_moment, sample_sensor, sample_weather
from fastgen.sampling.streams import Streams, one_of, stream, weighted_choice
from fastgen.sampling.visibility_estimates import DamageVisibility
from fastgen.scene import (
    Camera,
    EnvironmentView,
    Pose,
    Scene,
    Spreader,
    Vec3,
)
from fastgen.scene.limits import MAX_INSTANCES
from fastgen.validation import check_weights

SPLITS = ("train", "val", "test")


def sample_scene(config: Config, seed: int, index: int, environments: Mapping[str, float]) -> Scene:
    """Sample one scene of the dataset that `config` and `seed` describe.

    Args:
        config: Distribution of scenes.
        seed: Seed of the dataset.
        index: Index of the scene.
        environments: Weight of each available HDRI by name; see `environment_weights`.

    Returns:
        The sampled scene.

    Raises:
        ConfigError: `config.environment` leaves no HDRI, or lists one that is not available.
    """

    def streams(name: str) -> np.random.Generator:
        return stream(seed, index, name)

    kind = weighted_choice(streams("kind"), config.container.kinds)
    spreader = _spreader(config.spreader, streams)
    environment = _environment(config, streams, environments)
    weather = sample_weather(
        config.weather, environment.illuminance_lx, lambda part: streams(f"weather.{part}")
    )
    moment = sample_moment(config.sensor.stamp.years, hours_of(environment.name), streams("moment"))
    cameras = [_camera(name, rig, kind, streams) for name, rig in config.cameras.items()]
    surroundings = sample_surroundings(config, kind, spreader.present, cameras, streams)
    bodies = [(kind, Pose()), *((site.kind, site.pose) for site in surroundings.sites)]
    visibility = DamageVisibility(surroundings.cameras, bodies)
    first = sample_contents(config, kind, streams, partial(visibility.image_share, 0))
    # a spreader of this kind holds one container
    spreader = replace(spreader, present=spreader.present and not surroundings.twins)
    ground = None
    if surroundings.ground_mm is not None:
        ground = sample_ground(config.ground, surroundings.ground_mm, weather.wetness, streams)
    scene = Scene(
        seed=seed,
        index=index,
        **first._asdict(),
        environment=environment,
        cameras=tuple(
            _with_sensor(camera, config, moment, streams) for camera in surroundings.cameras
        ),
        spreader=spreader,
        neighbours=sample_neighbours(config, surroundings.sites, first, streams, visibility),
        ground=ground,
        props=surroundings.props,
        weather=weather,
    )
    absent = streams("absent").random() < config.container.absent
    if absent:
        return without_container(scene)
    return _distinguishable(config, scene, surroundings, streams)


def _distinguishable(
    config: Config, scene: Scene, surroundings: Surroundings, streams: Streams
) -> Scene:
    """Return a scene without the damages that masks could not distinguish."""
    carried = [scene.damages, *(each.damages for each in scene.neighbours)]
    counts = Counter(damage.kind for damages in carried for damage in damages)
    if max(counts.values(), default=0) <= MAX_INSTANCES:
        return scene
    theirs = of_neighbours(config).damage
    drawn = [(config.damage, streams)]
    drawn += [(theirs, streams_of(site, streams)) for site in surroundings.sites]
    listed = [len(listed_kinds(damage, own)) for damage, own in drawn]
    first, *others = within_limit(carried, listed)
    neighbours = zip(scene.neighbours, others, strict=True)
    return replace(
        scene,
        damages=first,
        neighbours=tuple(replace(each, damages=damages) for each, damages in neighbours),
    )


def without_container(scene: Scene) -> Scene:
    """Return a scene that shows only the panorama and the ground of `scene`."""
    return replace(
        scene,
        container=replace(scene.container, present=False),
        decals=(),
        damages=(),
        seals=(),
        spreader=replace(scene.spreader, present=False),
        neighbours=(),
        props=(),
    )


def split_of(config: Config, seed: int, index: int) -> str:
    """Return the split of a scene.

    Args:
        config: Distribution of scenes with the shares of the splits.
        seed: Seed of the dataset.
        index: Index of the scene.

    Returns:
        'train', 'val' or 'test'; the number of scenes has no influence.
    """
    shares = np.array([config.split.train, config.split.val, config.split.test])
    edges = np.cumsum(shares / shares.sum())
    return SPLITS[int(np.searchsorted(edges[:2], stream(seed, index, "split").random(), "right"))]


def environment_weights(config: Config, available: Mapping[str, float]) -> dict[str, float]:
    """Return the weight of each HDRI that a configuration draws from, sorted by name.

    Args:
        config: Distribution of scenes.
        available: Weight of each available HDRI by name, for a configuration without its own.

    Raises:
        ConfigError: A listed HDRI is not available, or no HDRI has a weight above 0.
    """
    wanted = config.environment.names
    for name in wanted:
        if name not in available:
            raise ConfigError(
                f"environment.names: HDRI {name!r} is not available{nearest(name, available)}"
            )
    usual = dict.fromkeys(sorted(wanted), 1.0) or dict(sorted(available.items()))
    weights = {name: config.environment.weights.get(name, own) for name, own in usual.items()}
    check_weights("environment.weights", weights.values())
    return weights


def _environment(
    config: Config, streams: Streams, environments: Mapping[str, float]
) -> EnvironmentView:
    name = weighted_choice(streams("environment"), environment_weights(config, environments))
    yaw_deg = config.environment.yaw_deg.draw(streams("environment.yaw"))
    lx = config.environment.illuminance_lx.get(name, illuminance_of(name))
    lamps = sample_lamps(config.environment.lamps, lx, streams("environment.lamps"))
    return EnvironmentView(name, yaw_deg, lx, lamps)


def _spreader(c: SpreaderConfig, streams: Streams) -> Spreader:
    lowered = streams("spreader.flippers").random(2) < c.flippers_down
    gap = rounded_gap_mm(c, c.gap_mm.draw(streams("spreader.gap")))
    return Spreader(
        present=bool(streams("spreader").random() < c.probability),
        albedo=linear_color(one_of(streams("spreader.color"), c.colors)),
        flippers_down=(bool(lowered[0]), bool(lowered[1])),
        gap_mm=gap,
    )


def rounded_gap_mm(config: SpreaderConfig, gap_mm: float) -> float:
    """Round the gap between spreader and container to 10 mm, within the range of `config`.

    Few different gaps mean few shapes to build and cache.
    """
    low, high = config.gap_mm
    return min(max(10.0 * round(gap_mm / 10), low), high)


def _camera(name: str, rig: CameraConfig, kind: str, streams: Streams) -> Camera:
    """Sample a camera that looks at the middle of its face, within the ranges of the rig."""
    rng = streams(f"camera.{name}")
    frame = face_frame(rig.face, kind)
    azimuth_deg, elevation_deg = rig.azimuth_deg.draw(rng), rig.elevation_deg.draw(rng)
    direction = direction_from(frame, azimuth_deg, elevation_deg)
    shift = rig.target_shift_mm.draw(rng) * frame.right + rig.target_shift_mm.draw(rng) * frame.up
    aim = streams(f"camera.{name}.aim")
    across, along = frame.half_mm
    shift += (
        rig.aim_right.draw(aim) * across * frame.right + rig.aim_up.draw(aim) * along * frame.up
    )
    target = frame.middle_mm + shift
    position = _rounded(target + direction * rig.distance_mm.draw(rng))
    roll = rig.roll_deg.draw(rng)
    camera = Camera(
        name=name,
        position_mm=position,
        target_mm=_rounded(target),
        focal_mm=rig.focal_mm,
        pixel_aspect=rig.pixel_aspect,
        principal_point=rig.principal_point,
        roll_deg=round(roll, 3),
        sensor_width_mm=rig.sensor_width_mm,
        exposure_ev=round(rig.exposure_ev.draw(rng), 3),
        lens=sample_lens(rig.lens, streams(f"lens.{name}")) if rig.lens else None,
    )
    if frame.outward[2] == 0:
        return camera
    # A view along the vertical has no defined up. The face's right is the image's right there.
    rows = view_of(replace(camera, roll_deg=0.0, lens=None), (1, 1)).rotation
    level = math.degrees(math.atan2(-rows[1] @ frame.right, rows[0] @ frame.right))
    return replace(camera, roll_deg=round((roll + level + 180) % 360 - 180, 3))


def _with_sensor(camera: Camera, config: Config, moment: datetime, streams: Streams) -> Camera:
    distance_mm = float(np.linalg.norm(np.subtract(camera.position_mm, camera.target_mm)))
    sensor = sample_sensor(
        config.sensor, distance_mm, moment, lambda part: streams(f"sensor.{camera.name}.{part}")
    )
    return replace(camera, sensor=sensor)


def _rounded(point: np.ndarray) -> Vec3:
    x, y, z = (round(float(v), 1) for v in point)
    return x, y, z
