"""Numbers of decals and seals in the id target, and of damages in the damage target."""

from fastgen.classes import (
    CONTAINER_ID,
    DAMAGE_CLASSES,
    DAMAGE_VALUES,
    SEAL_ID,
    SEGMENTATION_CLASSES,
    SPREADER_ID,
)
from fastgen.scene.data import Damage, Scene, Seal


def object_ids(scene: Scene) -> list[int]:
    """Return the id of each decal in the id target, in scene order.

    Labelled decals get 2, 3, ..., skipping the values of damages. Unlabelled decals get 0.
    """
    numbers = range(CONTAINER_ID + 1, SPREADER_ID)
    free = (number for number in numbers if number not in DAMAGE_VALUES)
    return [next(free) if decal.class_name else 0 for decal in scene.decals]


def seal_id(seal: Seal) -> int:
    """Return the id of a seal, which its hasp decides."""
    return SEAL_ID + seal.hasp


def mask_values(damages: tuple[Damage, ...]) -> list[int]:
    """Return the value of each damage in the damage target: category * 100 + instance.

    Source: SeaFront paper, section 3.3.4.
    """
    counts = dict.fromkeys(DAMAGE_CLASSES, 0)
    values = []
    for damage in damages:
        counts[damage.kind] += 1
        category = SEGMENTATION_CLASSES.index(damage.kind) + 1
        values.append(category * 100 + counts[damage.kind])
    return values
