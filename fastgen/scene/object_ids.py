"""Numbers of containers, decals and seals in the id target, and of damages in the damage target."""

from dataclasses import dataclass

from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    ALL_SEGMENTATION_CLASSES,
    CONTAINER_ID,
    SEAL_ID,
    SPREADER_ID,
    UNDAMAGED_CONTAINER,
    segmentation_classes,
)
from fastgen.scene.data import Damage, Scene, Seal
from fastgen.scene.decal import Decal
from fastgen.scene.limits import HASPS


@dataclass(frozen=True)
class Numbers:
    """Numbers of one container and what it carries. No two objects of a scene share a number.

    Attributes:
        container: Id of the container.
        decals: Id of each decal in scene order, 0 for decals without a label.
        first_seal: Id of a seal at the first hasp; those of the other hasps follow.
        undamaged: Value of undamaged container in the damage target: category * 100 + instance.
        damages: Value of each damage there, which is also its id.
    """

    container: int
    decals: tuple[int, ...]
    first_seal: int
    undamaged: int
    damages: tuple[int, ...]

    def seal(self, seal: Seal) -> int:
        """Return the id of a seal, which its hasp decides."""
        return self.first_seal + seal.hasp


def scene_numbers(scene: Scene) -> list[Numbers]:
    """Return the numbers of the first container and of each neighbour.

    Ids count up from CONTAINER_ID, container by container, and skip the values of damages.
    Instances of damages count up over all containers (SeaFront paper, section 3.3.4).
    """
    carried: list[tuple[tuple[Decal, ...], tuple[Damage, ...]]] = [(scene.decals, scene.damages)]
    carried += [(each.decals, each.damages) for each in scene.neighbours]
    kinds = {damage.kind for _, damages in carried for damage in damages}
    # the values of later kinds stay free for ids, so that a new kind does not change older scenes
    taken = range(200, 100 * (len(segmentation_classes(kinds)) + 1))
    free = (number for number in range(CONTAINER_ID, SPREADER_ID) if number not in taken)
    values = iter(mask_values(tuple(damage for _, damages in carried for damage in damages)))
    return [
        Numbers(
            container=next(free),
            decals=tuple(next(free) if decal.class_name else 0 for decal in decals),
            first_seal=SEAL_ID + HASPS * number,
            undamaged=UNDAMAGED_CONTAINER + number,
            damages=tuple(next(values) for _ in damages),
        )
        for number, (decals, damages) in enumerate(carried)
    ]


def object_ids(scene: Scene) -> list[int]:
    """Return the id of each decal of the first container, 0 for decals without a label."""
    return list(scene_numbers(scene)[0].decals)


def mask_values(damages: tuple[Damage, ...]) -> list[int]:
    """Return the value of each damage in the damage target: category * 100 + instance.

    Source: SeaFront paper, section 3.3.4.
    """
    counts = dict.fromkeys(ALL_DAMAGE_CLASSES, 0)
    values = []
    for damage in damages:
        counts[damage.kind] += 1
        category = ALL_SEGMENTATION_CLASSES.index(damage.kind) + 1
        values.append(category * 100 + counts[damage.kind])
    return values
