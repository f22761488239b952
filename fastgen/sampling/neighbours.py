"""Sampling of a scene's neighbours, of the vehicles below containers, and of the ground."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fastgen.config.config import Config
from fastgen.config.fields import linear_color
from fastgen.config.surroundings import GroundConfig
from fastgen.errors import ConfigError
from fastgen.sampling.arrangements import Plan, Site, sample_plan
from fastgen.sampling.contents import Contents, of_neighbours, sample_contents
from fastgen.sampling.streams import Streams, one_of, weighted_choice
from fastgen.sampling.visibility_estimates import BoxVisibility, DamageVisibility
from fastgen.scene import Camera, Ground, Neighbour, Pose, Prop, Vec3
from fastgen.scene.boxes import (
    OrientedBox,
    away_mm,
    back_to_front,
    container_box,
    overlap,
    spreader_box,
)
from fastgen.scene.limits import CAMERA_REACH_MM, MAX_NEIGHBOURS, MAX_PROPS

LEAST_DISTANCE_MM = 300.0
"""Least distance of a camera from neighbours and from the ground."""

MOST_HIDDEN = 0.6
"""Largest share of the container's visible box that neighbours may hide from a camera."""


class Surroundings(NamedTuple):
    """Surroundings of a container, and the cameras, which may have been moved.

    Attributes:
        cameras: All cameras.
        ground_mm: Height of the ground; None without ground.
        sites: Kinds and poses of the neighbours.
        props: Parts of all vehicles.
        twins: Whether the first neighbour is the container's twin.
    """

    cameras: tuple[Camera, ...]
    ground_mm: float | None = None
    sites: tuple[Site, ...] = ()
    props: tuple[Prop, ...] = ()
    twins: bool = False


def sample_surroundings(
    config: Config, kind: str, held: bool, cameras: Sequence[Camera], streams: Streams
) -> Surroundings:
    """Sample where the neighbours, their vehicles and the ground are.

    Args:
        config: Distribution of scenes; its rig has the cameras.
        kind: Kind of the container.
        held: True if a spreader is on it.
        cameras: Cameras as if there was only the container.
        streams: Function from the name of a property to its independent random generator.
    """
    floor_mm = min(camera.position_mm[2] for camera in cameras) - LEAST_DISTANCE_MM
    plan = sample_plan(config, kind, held, floor_mm, streams)
    if plan.ground_mm is None:
        return Surroundings(tuple(cameras))

    def start(plan: Plan) -> _Taken:
        return _Taken(kind, held, plan, [(config.cameras[c.name].face, c) for c in cameras])

    taken = start(plan)
    if plan.twin and not taken.take(plan.twin):
        plan = plan._replace(twin=None)
        taken = start(plan)
    if not all(map(taken.take, plan.below)):
        plan = sample_plan(config, kind, held, floor_mm, streams, at_bottom=True)
        taken = start(plan)
    taken.fill(plan)
    return Surroundings(
        cameras=taken.cameras,
        ground_mm=plan.ground_mm,
        sites=tuple(taken.sites),
        props=tuple(taken.props),
        twins=plan.twin is not None,
    )


def sample_neighbours(
    config: Config,
    sites: Iterable[Site],
    first: Contents,
    streams: Streams,
    visibility: DamageVisibility,
) -> tuple[Neighbour, ...]:
    """Sample the contents of the neighbours at their sites.

    Args:
        config: Distribution of scenes.
        sites: Kinds and poses of the neighbours.
        first: Contents of the container.
        streams: Function from the name of a property to its independent random generator.
        visibility: Estimates for the container and the neighbours in the order of their sites.
    """
    theirs = of_neighbours(config)

    def neighbour(body: int, site: Site) -> Neighbour:
        own = streams_of(site, streams)
        alike = own("same_paint").random() < config.placement.same_paint
        color = first.surface.paint.name if alike else None
        image_share = partial(visibility.image_share, body)
        contents = sample_contents(theirs, site.kind, own, image_share, color)
        return Neighbour(site.pose, **contents._asdict())

    return tuple(itertools.starmap(neighbour, enumerate(sites, start=1)))


def streams_of(site: Site, streams: Streams) -> Streams:
    """Return the streams of the neighbour at a site."""
    return lambda name: streams(f"{site.name}.{name}")


def sample_ground(
    config: GroundConfig, height_mm: float, wetness: float, streams: Streams
) -> Ground:
    """Sample the surface of the ground.

    Args:
        config: Distribution of grounds.
        height_mm: Height of the ground in the world.
        wetness: Wetness of the containers, 0 to 1.
        streams: Function from the name of a property to its independent random generator.
    """
    kind = weighted_choice(streams("ground.kind"), config.kinds)
    tone = config.albedo(kind).draw(streams("ground.albedo"))
    # from a cold to a warm grey
    tint = streams("ground.tint").uniform(-0.06, 0.06)
    red, green, blue = (round(min(tone * (1 + part), 1.0), 4) for part in (tint, 0.0, -tint))
    wet = streams("ground.wet")
    if wet.random() < config.wet_probability:
        wetness = max(wetness, config.wetness.draw(wet))
    lines = streams("ground.lines")
    painted = lines.random() < config.line_probability
    x, y = streams("ground.noise").uniform(0, 50000, 2).round(1).tolist()
    return Ground(
        kind=kind,
        height_mm=height_mm,
        albedo=(red, green, blue),
        wetness=round(wetness, 4),
        wear=round(config.wear.draw(streams("ground.wear")), 4),
        line_albedo=linear_color(one_of(streams("ground.line_color"), config.line_colors)),
        lines=round(config.line_paint.draw(lines), 4) if painted else 0.0,
        line_yaw_deg=round(config.line_yaw_deg.draw(lines), 3),
        line_spacing_mm=round(config.line_spacing_mm.draw(lines), 1),
        reach_mm=round(config.reach_mm.draw(streams("ground.reach")), 1),
        noise_offset_mm=(x, y),
    )


class _Taken:
    """Sites that were taken, and the cameras that they may not cover.

    Args:
        kind: Kind of the container.
        held: True if a spreader is on it.
        plan: Arrangement with a ground.
        rig: Each camera, and the face that it looks at.
    """

    def __init__(
        self, kind: str, held: bool, plan: Plan, rig: Sequence[tuple[str, Camera]]
    ) -> None:
        assert plan.ground_mm is not None
        self.sites: list[Site] = []
        self.props = list(plan.props)
        self._ground_mm = plan.ground_mm
        own = container_box(kind, Pose())
        self._boxes = [own]
        self._room = [own, *([spreader_box(kind)] if held else [])]
        views = [_view(camera, face, own, plan.twin) for face, camera in rig]
        raised = [(_above(camera, plan.ground_mm), box) for camera, box in views]
        self.cameras = tuple(camera for camera, _ in raised)
        self._eyes = [np.array(camera.position_mm) for camera in self.cameras]
        self._visibilities = [BoxVisibility(box, camera) for camera, box in raised]

    def fill(self, plan: Plan) -> None:
        """Take sites until there are as many neighbours as planned."""
        wanted = plan.wanted + (plan.twin is not None)
        for pile in itertools.chain([plan.above], plan.piles):
            for site in pile:
                # nothing can be on top of a site that was not taken
                if len(self.sites) >= wanted or not self.take(site):
                    break
            if len(self.sites) >= wanted:
                return

    def take(self, site: Site) -> bool:
        """Take a site if there is room for its container, as PlacementConfig describes."""
        if len(self.sites) == MAX_NEIGHBOURS or len(self.props) + len(site.props) > MAX_PROPS:
            return False
        box = container_box(site.kind, site.pose)
        if any(overlap(box, other) for other in self._room):
            return False
        whole = _down_to(box, self._ground_mm) if site.props else box
        away = [away_mm(whole, eye) for eye in self._eyes]
        if min(away) < LEAST_DISTANCE_MM or max(away) > CAMERA_REACH_MM:
            return False
        hidden = [(each, each.behind(box)) for each in self._visibilities]
        shares = (each.share(points) for each, points in hidden)
        if max(shares, default=0.0) > MOST_HIDDEN or not self._in_order([*self._boxes, box]):
            return False
        for each, points in hidden:
            each.hide(points)
        self._boxes.append(box)
        self._room.append(box)
        self.sites.append(site)
        self.props.extend(site.props)
        return True

    def _in_order(self, boxes: Sequence[OrientedBox]) -> bool:
        """Return whether the renderer can draw boxes over one another for each camera."""
        try:
            for eye in self._eyes:
                back_to_front(boxes, eye)
        except ConfigError:
            return False
        return True


def _view(
    camera: Camera, face: str, own: OrientedBox, twin: Site | None
) -> tuple[Camera, OrientedBox]:
    """Return a camera and the box that it looks at.

    A camera that looks at the end where the twin is moves along, to see the twin's outer end.
    """
    if twin is None:
        return camera, own
    shift = twin.pose.position_mm[0]
    if face != ("door" if shift > 0 else "no_door"):
        return camera, own
    moved = replace(
        camera,
        position_mm=_shifted(camera.position_mm, shift),
        target_mm=_shifted(camera.target_mm, shift),
    )
    return moved, container_box(twin.kind, twin.pose)


def _shifted(point: Vec3, along_mm: float) -> Vec3:
    return round(point[0] + along_mm, 1), point[1], point[2]


def _above(camera: Camera, ground_mm: float) -> Camera:
    """Return a camera that is not too close to the ground."""
    x, y, z = camera.position_mm
    return replace(camera, position_mm=(x, y, max(z, round(ground_mm + LEAST_DISTANCE_MM, 1))))


def _down_to(box: OrientedBox, ground_mm: float) -> OrientedBox:
    """Return a box that reaches down to the ground, so that it includes a vehicle."""
    top = box.center_mm[2] + box.half_mm[2]
    half = np.array([*box.half_mm[:2], (top - ground_mm) / 2])
    return OrientedBox(np.array([*box.center_mm[:2], top - half[2]]), half, box.rotation)
