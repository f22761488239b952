"""Test cases with a ground: alone, among neighbours, on a trailer, or with one damage close up.

Their numbers follow those of the 32 cases of reference_set.py.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from reference_set import RUSTY, SEED, SIZE, Case, cases

from fastgen import Config, Generator
from fastgen.sampling.ground import trailer_props
from fastgen.scene import Camera, EnvironmentView, Ground, Neighbour, Pose, Prop, Scene, Vec3
from fastgen.scene.container_kinds import KINDS

_CAMERA = "S"
_WIDTH_MM, _HEIGHT_MM = KINDS["20"].width_mm, KINDS["20"].height_mm
_REACH_MM = 24000.0
_TWIST_LOCK_MM = 25.0
_LANE_MM = -4200.0
"""y of the middle of the lane beside a stack."""


@dataclass(frozen=True)
class SurroundedCase(Case):
    """A case whose container stands on a ground, alone or among neighbours.

    Attributes:
        name: What the case shows.
        yaw_deg: Rotation of the environment.
        ground: The ground, at height 0.
        view: The only camera.
        poses: Poses of the neighbours.
        on_trailer: Put the last neighbour on a trailer.
        damage: Values of the configuration's `damage` for a case that shows one damage close up.
    """

    name: str
    yaw_deg: float
    ground: Ground
    view: Camera
    poses: tuple[Pose, ...] = ()
    on_trailer: bool = False
    damage: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def config(self) -> Config:
        """The configuration that the contents of the containers are sampled from."""
        return Config.from_values(
            {
                "container": {"kinds": {"20": 1}},
                "spreader": {"probability": 0},
                "environment": {"names": [self.light]},
                "damage": {"probability": float(self.damaged), **self.damage},
                "surface": {"rust_coverage": RUSTY if self.rusty else 0.0},
            }
        )

    @property
    def texel_mm(self) -> float:
        """Size in mm of the texels that Cycles sees; at most half a pixel close to a damage."""
        return 1.5 if self.damage else super().texel_mm

    def drawn(self) -> Scene:
        """Build the scene from containers that the current code samples."""
        generator = Generator(self.config, SEED, SIZE)
        own, *others = (generator.scene(10 * self.number + i) for i in range(1 + len(self.poses)))
        poses = list(self.poses)
        props: tuple[Prop, ...] = ()
        if self.on_trailer:
            poses[-1], props = _on_trailer(poses[-1])
        neighbours = tuple(
            Neighbour(pose, s.container, s.surface, s.decals, s.damages, s.seals)
            for pose, s in zip(poses, others, strict=True)
        )
        return replace(
            own,
            environment=EnvironmentView(self.light, self.yaw_deg),
            cameras=(self.view,),
            neighbours=neighbours,
            ground=self.ground,
            props=props,
        )


def _on_trailer(pose: Pose) -> tuple[Pose, tuple[Prop, ...]]:
    """Return a pose on the ground, not turned, raised onto a trailer, and the trailer's parts."""
    ground_mm, parts = trailer_props("20", np.random.default_rng(SEED))
    raised = _moved(pose, (0.0, 0.0, -ground_mm))
    return raised, tuple(
        replace(part, pose=_moved(part.pose, raised.position_mm)) for part in parts
    )


def _moved(pose: Pose, by_mm: Vec3) -> Pose:
    x, y, z = (a + b for a, b in zip(pose.position_mm, by_mm, strict=True))
    return Pose((x, y, z), pose.yaw_deg)


def _ground(kind: str, albedo: tuple[float, float, float], wear: float, lines: float) -> Ground:
    return Ground(
        kind, 0.0, albedo, wear=wear, lines=lines, reach_mm=_REACH_MM, noise_offset_mm=(700.0, 0.0)
    )


def surrounded_cases() -> list[SurroundedCase]:
    """Return the cases, whose numbers follow those of `reference_set.cases`."""
    asphalt, concrete = (0.09, 0.09, 0.095), (0.27, 0.265, 0.25)
    beside = _WIDTH_MM + 600.0
    raised = _HEIGHT_MM + _TWIST_LOCK_MM
    return [
        SurroundedCase(
            32, _CAMERA, "sky", False, True, "standing in the sun", 94.0,
            _ground("asphalt", asphalt, 0.5, 0.6),
            Camera(_CAMERA, (7000.0, -6500.0, 2600.0), (1200.0, -1200.0, 600.0), 26.0),
        ),
        SurroundedCase(
            33, _CAMERA, "venice", False, False, "row under clouds", 20.0,
            _ground("concrete", concrete, 0.0, 0.0),
            Camera(_CAMERA, (7800.0, 1480.0, 1700.0), (0.0, 1519.0, 1000.0), 38.0),
            (Pose((0.0, beside, 0.0)), Pose((0.0, -beside, 0.0))),
        ),
        SurroundedCase(
            34, _CAMERA, "port_noon", True, False, "row in the sun", 110.0,
            _ground("asphalt", asphalt, 0.3, 0.0),
            Camera(_CAMERA, (8500.0, -2800.0, 2600.0), (0.0, -1200.0, 1000.0), 28.0),
            (
                Pose((0.0, -_WIDTH_MM - 900.0, 0.0)),
                Pose((1200.0, beside + 100.0, 0.0), 2.0),
            ),
        ),
        SurroundedCase(
            35, _CAMERA, "sky", False, True, "stack beside a trailer", 104.0,
            _ground("concrete", concrete, 0.5, 0.0),
            Camera(_CAMERA, (10500.0, -2600.0, 2400.0), (0.0, -2000.0, 2100.0), 26.0),
            (Pose((0.0, 0.0, raised)), Pose((-600.0, _LANE_MM, 0.0))),
            on_trailer=True,
        ),
        SurroundedCase(
            36, _CAMERA, "port_noon", True, True, "roof and ground", 70.0,
            _ground("asphalt", asphalt, 0.4, 0.5),
            Camera(_CAMERA, (4500.0, 4500.0, 8500.0), (200.0, 400.0, 1200.0), 26.0),
        ),
        SurroundedCase(
            37, _CAMERA, "sky", True, False, "folds close up", 230.0,
            _ground("concrete", concrete, 0.3, 0.0),
            Camera(_CAMERA, (200.0, -4300.0, 1900.0), (-1465.0, -1204.0, 960.0), 60.0),
            damage={
                "kinds": ["concave"], "count": 1, "faces": ["front"],
                "concave": {"buckled": 0, "creased": 1, "outward": 0},
            },
        ),
        SurroundedCase(
            38, _CAMERA, "port_noon", True, False, "torn hole close up", 110.0,
            _ground("asphalt", asphalt, 0.3, 0.0),
            Camera(_CAMERA, (-900.0, -3400.0, 1500.0), (-2076.0, -1204.0, 789.0), 90.0),
            damage={
                "kinds": ["perforation"], "count": 1, "faces": ["front"],
                "perforation": {"torn": 1, "split": 0, "tear_length_mm": [450, 700]},
            },
        ),
    ]  # fmt: skip


def every_case() -> list[Case]:
    """Return the cases of `reference_set.cases`, then the surrounded ones, by number."""
    return [*cases(), *surrounded_cases()]
