"""Frequency and kinds of damage. The ranges of each kind are in its module of fastgen.damages."""

from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass
from typing import TYPE_CHECKING, Annotated, Any

from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    BUNDLED_DAMAGE_CLASSES,
    DAMAGE_CLASSES,
    MOST_DAMAGE_CLASSES,
    PACKAGE_DAMAGE_CLASSES,
    segmentation_classes,
)
from fastgen.errors import ConfigError
from fastgen.scene.damage_kinds import bundled_kind, forms_of, kind_named, program_kinds
from fastgen.scene.faces import SHEET_FACES
from fastgen.scene.limits import MAX_INSTANCES
from fastgen.validation import Bounds, OneOf, Share, check_distinct, check_known, from_plain


@dataclass(frozen=True)
class _Frequencies:
    """Frequency and kinds of damage (SeaFront paper, Table 2).

    Attributes:
        probability: Probability that a container is damaged.
        count: Number of damages of a damaged container; all numbers are equally likely.
        kinds: Kinds to draw from; all are equally likely. The first four are the paper's. Others
            become further classes of the damage task where they are listed. Installed packages may
            offer more.
        faces: Faces to draw from; axis damages take any edge instead, and door_gear is always on
            the door. The extents below are cut to the size of the face.
        toward_cameras: Share of the damages that are drawn again until a camera shows them: their
            middle is in its image and not behind another container, and their sheet is turned to it
            by at most 75 degrees and covers at least 0.1 % of the image. After 30 draws the largest
            one in an image stays. 0 places all damages regardless of the cameras, as the paper
            does.
        mask_threshold_mm: Displacement above which a pixel belongs to the mask of a damage. The
            mask of a kind without displacement, such as `scrape`, covers the area that it marks and
            no other damage moves.
        ranges: Ranges of kinds that packages offer, by kind, as in `{buckle: {length_mm: 900}}`.
    """

    probability: Share = 0.4
    count: Annotated[tuple[int, int], Bounds(0, MAX_INSTANCES)] = (1, 4)
    kinds: tuple[Annotated[str, OneOf(ALL_DAMAGE_CLASSES)], ...] = DAMAGE_CLASSES
    faces: tuple[Annotated[str, OneOf(SHEET_FACES)], ...] = ("front", "back", "door", "no_door")
    toward_cameras: Share = 0.0
    mask_threshold_mm: Annotated[float, Bounds(0.1, 1000.0, "mm")] = 5.0
    ranges: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def segmentation_classes(self) -> tuple[str, ...]:
        """Classes of the damage task, in the order of YOLO labels."""
        return segmentation_classes(self.kinds)

    def __post_init__(self) -> None:
        """Refuse kinds that cannot be drawn or numbered, and damages that have no face."""
        for name in ("kinds", "faces"):
            check_distinct(name, getattr(self, name), "each is as likely as any other")
        if not self.kinds and self.probability > 0 and self.count[1] > 0:
            raise ConfigError("kinds: the list is empty; give at least one, or probability: 0")
        for kind in self.kinds:
            number = ALL_DAMAGE_CLASSES.index(kind) + 1
            if number > MOST_DAMAGE_CLASSES:
                raise ConfigError(
                    f"kinds: {kind} is number {number} of all installed kinds, and labels have "
                    f"numbers for {MOST_DAMAGE_CLASSES}; uninstall packages with others"
                )
        try:
            forms_of(program_kinds(self.kinds))
            placed = {kind for kind in self.kinds if kind_named(kind).place}
        except ConfigError as error:
            raise ConfigError(str(error).removeprefix("damage.")) from error
        if not self.faces and set(self.kinds) - placed:
            raise ConfigError("faces: the list is empty; give at least one, or kinds: [axis]")
        for kind in self.ranges:
            if kind in BUNDLED_DAMAGE_CLASSES:
                raise ConfigError(f"ranges.{kind}: write the ranges under damage.{kind}")
            if not PACKAGE_DAMAGE_CLASSES:
                raise ConfigError(f"ranges.{kind}: no installed package offers kinds; install it")
            check_known("ranges", kind, PACKAGE_DAMAGE_CLASSES)
            self.ranges_of(kind)

    def ranges_of(self, kind: str) -> Any:
        """Return the ranges of a kind, an instance of `Kind.ranges`."""
        if kind in BUNDLED_DAMAGE_CLASSES:
            return getattr(self, kind)
        given: Mapping[str, Any] = self.ranges.get(kind, {})
        return from_plain(kind_named(kind).ranges, given, f"ranges.{kind}")

    @property
    def bulge_mm(self) -> float:
        """Largest outward displacement of a face by one damage."""
        if not (self.probability > 0 and self.count[1] > 0):
            return 0.0
        kinds = map(kind_named, self.kinds)
        return max([0.0, *(kind.bulge_mm(self.ranges_of(kind.name)) for kind in kinds)])


if TYPE_CHECKING:
    DamageConfig = _Frequencies
else:
    # each bundled kind has a section of its own name
    DamageConfig = make_dataclass(
        "DamageConfig",
        [
            (kind.name, kind.ranges, field(default_factory=kind.ranges))
            for kind in map(bundled_kind, BUNDLED_DAMAGE_CLASSES)
        ],
        bases=(_Frequencies,),
        namespace={"__doc__": _Frequencies.__doc__, "__module__": __name__},
        frozen=True,
    )
