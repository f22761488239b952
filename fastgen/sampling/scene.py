"""Sampling of a scene from (config, seed, index), with the same result on every machine.

Each property has its own random stream, named after the property. New properties and additional
draws therefore leave all other properties of a scene unchanged.
"""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime

import numpy as np

from fastgen.camera.projection import view_of
from fastgen.config.cameras import CameraConfig, direction_from, face_frame
from fastgen.config.config import Config, SpreaderConfig, linear_color
from fastgen.errors import ConfigError
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.shape_library import SHAPES
from fastgen.light.hdri import hours_of, illuminance_of
from fastgen.sampling.damage import sample_damages
from fastgen.sampling.markings import sample_decals
from fastgen.sampling.runs import sample_runs
from fastgen.sampling.seals import sample_seals
from fastgen.sampling.sensor import sample_lens, sample_moment, sample_sensor, sample_weather
from fastgen.sampling.sheet import Sheet
from fastgen.sampling.streams import Streams, weighted_choice
from fastgen.scene import (
    Ageing,
    Camera,
    Container,
    Dirt,
    EnvironmentView,
    Paint,
    Rust,
    Scene,
    Scratches,
    Spreader,
    Surface,
    Vec3,
    Wear,
)
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.faces import SHEET_FACES
from fastgen.validation import Range, nearest

SPLITS = ("train", "val", "test")


def stream(seed: int, index: int, name: str) -> np.random.Generator:
    """Return the random generator of one property of one scene.

    Args:
        seed: Seed of the dataset.
        index: Index of the scene.
        name: Name of the property.

    Returns:
        PCG64 generator seeded with a hash of the arguments, independent of all other generators.
    """
    key = hashlib.blake2b(f"{seed}/{index}/{name}".encode(), digest_size=16).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(key, "little")))


def sample_scene(config: Config, seed: int, index: int, environments: Mapping[str, float]) -> Scene:
    """Sample one scene of the dataset that `config` and `seed` describe.

    Args:
        config: Distribution of scenes.
        seed: Seed of the dataset.
        index: Index of the scene.
        environments: Weight of each available HDRI by name. If `config.environment.names` is not
            empty, the HDRIs listed there are equally likely and the weights are ignored.

    Returns:
        The sampled scene.

    Raises:
        ConfigError: `config.environment.names` lists an HDRI that is not available.
    """

    def streams(name: str) -> np.random.Generator:
        return stream(seed, index, name)

    kind = weighted_choice(streams("kind"), config.container.kinds)
    scale = float(streams("corrugation").choice(config.container.depth_scale))
    container = Container(kind, config.container.profiles.deepened(scale))
    surface = _surface(config, streams)
    damages = sample_damages(config.damage, KINDS[kind].size_mm, streams)
    decals = sample_decals(
        config.markings, kind, _empty_sheets(container), surface.paint.albedo, streams
    )
    mesh = SHAPES.container(kind, container.profiles)
    runs = sample_runs(config.markings.runs, mesh, decals, damages, surface, streams)
    environment = _environment(config, streams, environments)
    hours = hours_of(environment.name)
    moment = sample_moment(config.sensor.stamp.years, hours, streams("moment"))
    scene = Scene(
        seed=seed,
        index=index,
        container=container,
        surface=surface,
        environment=environment,
        cameras=tuple(
            _with_sensor(_camera(name, rig, kind, streams), config, moment, streams)
            for name, rig in config.cameras.items()
        ),
        decals=(*decals, *runs),
        damages=damages,
        seals=sample_seals(config.seals, streams),
        spreader=_spreader(config.spreader, streams),
        weather=sample_weather(config.weather, lambda part: streams(f"weather.{part}")),
    )
    absent = streams("absent").random() < config.container.absent
    return without_container(scene) if absent else scene


def without_container(scene: Scene) -> Scene:
    """Return a scene that shows only the surroundings of `scene`."""
    return replace(
        scene,
        container=replace(scene.container, present=False),
        decals=(),
        damages=(),
        seals=(),
        spreader=replace(scene.spreader, present=False),
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


def _empty_sheets(container: Container) -> dict[str, Sheet]:
    """Return the sheets of a container without decals."""
    kind, profiles = container.kind, container.profiles
    mesh = SHAPES.container(kind, profiles)
    clearance = SHAPES.door_clearance(kind, profiles)
    return {
        face: Sheet(face, size, clearance=clearance)
        if face == "door"
        else Sheet(face, size, mesh.flats.get(face, ()))
        for face, size in sheet_sizes(mesh).items()
    }


def sheet_sizes(mesh: Mesh) -> dict[str, tuple[float, float]]:
    """Return the size of the unfolded sheet of each face that carries decals.

    Args:
        mesh: Container mesh.

    Returns:
        Width and height in mm by face.
    """
    rects = {face: mesh.charts[mesh.chart_index(face)].rect_mm for face in SHEET_FACES}
    return {face: (rect[2], rect[3]) for face, rect in rects.items()}


def _surface(config: Config, streams: Streams) -> Surface:
    c = config.surface
    weights = np.array(c.weights)
    # equal weights would give other results than no weights
    shares = weights / weights.sum() if c.color_weights else None
    name = str(streams("paint.color").choice(list(c.colors), p=shares))
    rust = streams("rust")
    rust_color = str(streams("rust.color").choice(c.rust_colors))
    # The square makes heavily rusted containers rare.
    low, high = c.rust_coverage
    coverage = low + (high - low) * float(rust.random()) ** 2
    return Surface(
        paint=Paint(
            name,
            linear_color(c.colors[name]),
            c.roughness.draw(streams("paint.roughness")),
            c.tone_variation.draw(streams("paint.tone")),
            c.bleach.draw(streams("paint.bleach")),
        ),
        ageing=Ageing(
            c.ageing_strength.draw(streams("ageing.strength")),
            c.ageing_reach_mm.draw(streams("ageing.reach")),
        ),
        dirt=Dirt(
            c.dirt_strength.draw(streams("dirt.strength")),
            c.dirt_reach_mm.draw(streams("dirt.reach")),
            linear_color(c.dirt_color),
            c.dirt_streaks.draw(streams("dirt.streaks")),
        ),
        rust=Rust(
            coverage,
            c.rust_scale_mm.draw(streams("rust.scale")),
            linear_color(rust_color),
            c.rust_roughness.draw(streams("rust.roughness")),
        ),
        scratches=Scratches(
            c.scratch_coverage.draw(streams("scratches")), c.scrapes.draw(streams("scrapes"))
        ),
        wear=Wear(
            c.wear_strength.draw(streams("wear")),
            c.wear_scale_mm.draw(streams("wear.scale")),
        ),
        noise_offset_mm=(
            Range(0, 50000).draw(streams("noise.x")),
            Range(0, 50000).draw(streams("noise.y")),
        ),
    )


def _environment(
    config: Config, streams: Streams, environments: Mapping[str, float]
) -> EnvironmentView:
    wanted = config.environment.names
    for name in wanted:
        if name not in environments:
            raise ConfigError(
                f"environment.names: HDRI {name!r} is not available{nearest(name, environments)}"
            )
    weights = dict.fromkeys(sorted(wanted), 1.0) or dict(sorted(environments.items()))
    name = weighted_choice(streams("environment"), weights)
    yaw_deg = config.environment.yaw_deg.draw(streams("environment.yaw"))
    lx = config.environment.illuminance_lx.get(name, illuminance_of(name))
    return EnvironmentView(name, yaw_deg, lx)


def _spreader(c: SpreaderConfig, streams: Streams) -> Spreader:
    lowered = streams("spreader.flippers").random(2) < c.flippers_down
    gap = rounded_gap_mm(c, c.gap_mm.draw(streams("spreader.gap")))
    return Spreader(
        present=bool(streams("spreader").random() < c.probability),
        albedo=linear_color(str(streams("spreader.color").choice(c.colors))),
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
    target = frame.middle_mm + shift
    position = _rounded(target + direction * rig.distance_mm.draw(rng))
    roll = rig.roll_deg.draw(rng)
    camera = Camera(
        name=name,
        position_mm=position,
        target_mm=_rounded(target),
        focal_mm=rig.focal_mm,
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
