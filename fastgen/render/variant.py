"""ShaderVariant: the choices that a shader program is compiled for."""

from dataclasses import dataclass

from fastgen.classes import DRAWN_DAMAGE_CLASSES

LAYERS = (
    *("all", "base", "tone", "ageing", "dirt", "rust", "scratches", "decals", "reflection"),
    "normals",
)
"""Material layers that can be rendered. `ids` and `damage` of `fastgen show` are label targets."""

DAMAGE_VARIANTS = ("undamaged", "damaged", "holed")
"""Programs for scenes without damage, with damage, and with at least one hole."""

PIXEL_CLASSES: dict[str, tuple[str, ...]] = {
    "plain": (),
    "decal": ("DECALS",),
    "mixed": ("MIXED",),
    "mixed_decal": ("MIXED", "DECALS"),
    "damaged": ("DECALS", "DAMAGE"),
    "mixed_damaged": ("MIXED", "DECALS", "DAMAGE"),
    "holed": ("MIXED", "DECALS", "DAMAGE", "HOLES"),
}
"""Classes of pixels that see more than sky, with the traits of each: MIXED pixels filter several
surfaces; DECALS, DAMAGE and HOLES may lie near. Each class has its list, see classify.comp. DECALS
and DAMAGE may add terms but must not change the filter, or the image would reveal its labels."""

PIXEL_TRAITS = ("MIXED", "DECALS", "DAMAGE", "HOLES")


@dataclass(frozen=True)
class GroundVariant:
    """Choices that a program of the ground is compiled for.

    llvmpipe takes 0.2 to 0.7 s to compile a program, so code that costs little when unused is in
    all of them.

    Attributes:
        kind: One of GROUNDS.
        boxes: Draw shadows and mirror images of containers.
        wet: Draw wet ground.
        plane: Draw the plane, which blends into the panorama.
        shadows: Draw the shadows of props on the plane.
        props: Draw props.
        coarse: Shade once per 2x2 pixels.
    """

    kind: str = "asphalt"
    boxes: bool = False
    wet: bool = False
    plane: bool = True
    shadows: bool = False
    props: bool = False
    coarse: bool = False


@dataclass(frozen=True)
class ShaderVariant:
    """Everything that a shader program is compiled for.

    Attributes:
        samples_per_axis: Samples per pixel along each axis.
        lookups: Lookups of the material layers per pixel: 1, 2 or 25.
        layer: One of LAYERS.
        pixel_class: A key of PIXEL_CLASSES.
        damage: One of DAMAGE_VARIANTS.
        kinds: Kinds of damage that it can draw, see damage_kinds.program_kinds.
        lights: Directional lights that the program can shade: 0, 1 or MAX_LIGHTS.
        traced: Read indirect light that rays found instead of the vertices' light.
        radiance: Write exposed linear radiance instead of tone-mapped and encoded colour.
        without: Material layers of LAYERS to leave out.
        over: Draw over an image that already shows what lies behind, not over the sky.
        lens: Undo lens distortion.
        ground: What the ground pass needs besides.
    """

    samples_per_axis: int = 1
    lookups: int = 1
    layer: str = "all"
    pixel_class: str = "plain"
    damage: str = "undamaged"
    kinds: tuple[str, ...] = DRAWN_DAMAGE_CLASSES
    lights: int = 0
    traced: bool = False
    radiance: bool = False
    without: tuple[str, ...] = ()
    over: bool = False
    lens: bool = False
    ground: GroundVariant = GroundVariant()

    @property
    def traits(self) -> tuple[str, ...]:
        """Traits of the pixel class."""
        return PIXEL_CLASSES[self.pixel_class]


def listed_classes(samples_per_axis: int) -> tuple[str, ...]:
    """Return the pixel classes of images with so many samples, in the order of their lists."""
    several = samples_per_axis > 1
    return tuple(name for name in PIXEL_CLASSES if several or not name.startswith("mixed"))
