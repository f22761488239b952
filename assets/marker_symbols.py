"""Symbols of dangerous-goods markers, drawn from the rules in several hands.

Every function returns SVG in units of the 1000 x 1000 marker, centred on the origin and about 300
units tall. `ink` is the symbol's colour. Voids are cut out, so the field shows through them.
Descriptions: UN Model Regulations 5.2.2.2.2; 49 CFR 172, appendix B (trefoil).
"""

import math
from itertools import count

from drawing import FONTS, rect, words

_IDS = count()


def cut(ink: str, solid: str, voids: str) -> str:
    """Return the white shapes `solid` without the black shapes `voids`, filled with `ink`."""
    name = f"cut{next(_IDS)}"
    return (
        f'<mask id="{name}" maskUnits="userSpaceOnUse" x="-400" y="-400" width="800" height="800">'
        f'<g fill="#fff" stroke="#fff" stroke-width="0">{solid}</g>'
        f'<g fill="#000" stroke="#000" stroke-width="0">{voids}</g></mask>'
        f'<rect x="-400" y="-400" width="800" height="800" fill="{ink}" mask="url(#{name})"/>'
    )


def path(d: str, more: str = "") -> str:
    return f'<path d="{d}" {more}/>'


def tongue(x: float, base: float, width: float, tip: tuple[float, float], bend: float) -> str:
    """Return a tongue of fire from (x, base) to `tip` that bends sideways by `bend`."""
    tip_x, tip_y = tip
    height = base - tip_y
    left, right = x - width / 2, x + width / 2
    return path(
        f"M{left} {base} C{left - 0.4 * width:.0f} {base - 0.42 * height:.0f} "
        f"{tip_x - bend:.0f} {tip_y + 0.5 * height:.0f} {tip_x} {tip_y} "
        f"C{tip_x - 0.25 * bend + 0.2 * width:.0f} {tip_y + 0.38 * height:.0f} "
        f"{right + 0.45 * width:.0f} {base - 0.4 * height:.0f} {right} {base} Z"
    )


_BOWL = path("M-104 20 C-124 80 -84 132 -34 134 L34 134 C86 132 124 80 104 20 Z")
_BAR = '<rect x="-128" y="146" width="256" height="20"/>'


def flame_tongues(ink: str, bar: bool = True) -> str:
    """Flame of thin tongues with voids between them."""
    tongues = [
        *((-84, 60, 50, (-112, -52), -24), (-48, 60, 62, (-50, -96), 22)),
        *((2, 60, 92, (22, -176), -30), (52, 60, 62, (70, -104), 26), (86, 60, 46, (116, -34), 8)),
    ]
    voids = [
        *((-58, 108, 26, (-72, -4), -14), (-16, 116, 34, (-6, -54), 22)),
        *((34, 116, 28, (44, -26), -16), (70, 96, 18, (84, 6), 8)),
    ]
    solid = _BOWL + "".join(tongue(*t) for t in tongues) + (_BAR if bar else "")
    return cut(ink, solid, "".join(tongue(*v) for v in voids))


def flame_solid(ink: str, bar: bool = True) -> str:
    """Flame with a closed body and one void."""
    outline = (
        "M8 -178 C60 -110 140 -50 140 50 C140 72 134 92 124 108 C122 76 106 50 84 38 C90 80 74 120 "
        "48 146 L-60 146 C-110 128 -138 92 -138 52 C-138 -30 -50 -60 -30 -140 "
        "C-8 -122 0 -100 0 -74 C16 -104 18 -144 8 -178 Z"
    )
    void = "M-6 30 C8 78 -30 96 -44 130 C-56 110 -58 96 -54 80 C-34 70 -10 60 -6 30 Z"
    return cut(ink, path(outline) + (_BAR if bar else ""), path(void))


def flame_swirl(ink: str, bar: bool = True) -> str:
    """Flame whose tongues lean to one side, with slit-like voids."""
    tongues = [
        *((-70, 50, 70, (-122, -20), -34), (-30, 50, 84, (-78, -118), -50)),
        *((26, 50, 96, (-4, -178), -46), (74, 50, 70, (76, -84), -34)),
    ]
    voids = [
        *((-48, 104, 16, (-96, 4), -30), (-6, 112, 22, (-40, -64), -36)),
        *((38, 116, 24, (24, -86), -34), (76, 104, 14, (74, -14), -20)),
    ]
    solid = _BOWL + "".join(tongue(*t) for t in tongues) + (_BAR if bar else "")
    return cut(ink, solid, "".join(tongue(*v) for v in voids))


FLAMES = (flame_tongues, flame_solid, flame_swirl)


def flame_over_circle(ink: str, flame: int) -> str:
    """Flame `FLAMES[flame]` over a ring, on a bar."""
    burning = f'<g transform="translate(0 -62) scale(0.72)">{FLAMES[flame](ink, bar=False)}</g>'
    width = (20, 26, 16)[flame]
    ring = f'<circle cx="0" cy="72" r="60" fill="none" stroke="{ink}" stroke-width="{width}"/>'
    return burning + ring + rect(-94, 148, 188, 18, ink)


def cylinder(ink: str, angle: float, valve_right: bool) -> str:
    """Slim gas cylinder that rises to the right by `angle` degrees."""
    body = (
        '<path d="M-190 -34 H118 C142 -34 156 -20 170 -13 H192 V-20 H222 V20 H192 V13 H170 '
        'C156 20 142 34 118 34 H-190 C-204 34 -210 20 -210 0 C-210 -20 -204 -34 -190 -34 Z"/>'
    )
    turn = f"rotate({-angle})" + ("" if valve_right else " rotate(180)")
    return f'<g fill="{ink}" transform="{turn}">{body}</g>'


def skull_wide(ink: str) -> str:
    """Skull above two crossed bones."""
    return cut(ink, _bones(96, 22, 170) + _HEAD, _FACE)


def skull_crossed(ink: str) -> str:
    """Skull in front of steeply crossed bones."""
    behind = _bones(70, 34, 190)
    gap = '<g stroke="#000" stroke-width="16">' + _HEAD + "</g>"
    return cut(ink, behind, gap) + cut(ink, _HEAD, _FACE)


def skull_line(ink: str) -> str:
    """Skull and bones in outline."""
    head = cut(ink, f'<g stroke="#fff" stroke-width="12">{_HEAD}</g>', _HEAD)
    bones = cut(ink, _bones(98, 20, 168), _bones(98, 20, 168, 5))
    face = f'<g fill="{ink}">{_FACE}</g>'
    return _hidden(bones, _HEAD) + head + face


def _hidden(svg: str, cover: str) -> str:
    """Return `svg` where `cover` does not hide it."""
    name = f"cut{next(_IDS)}"
    return (
        f'<mask id="{name}" maskUnits="userSpaceOnUse" x="-400" y="-400" width="800" height="800">'
        f'<rect x="-400" y="-400" width="800" height="800" fill="#fff"/>{cover}</mask>'
        f'<g mask="url(#{name})">{svg}</g>'
    )


_HEAD = path(
    "M0 -150 C92 -150 138 -94 130 -18 C126 20 104 30 98 52 C94 78 86 92 58 92 L-58 92 "
    "C-86 92 -94 78 -98 52 C-104 30 -126 20 -130 -18 C-138 -94 -92 -150 0 -150 Z"
)
_FACE = (
    '<ellipse cx="-52" cy="-20" rx="36" ry="38"/><ellipse cx="52" cy="-20" rx="36" ry="38"/>'
    + path("M0 12 l20 40 h-40 Z")
    + "".join(f'<rect x="{x}" y="62" width="9" height="32"/>' for x in (-46, -5, 36))
)


def _bones(y: float, angle: float, reach: float, thinner: float = 0.0) -> str:
    end = 21 - thinner
    knobs = "".join(
        f'<circle cx="{x}" cy="{dy}" r="{end}"/>' for x in (-reach, reach) for dy in (-16, 16)
    )
    shaft = rect(-reach, -12 + thinner, 2 * reach, 24 - 2 * thinner, "inherit").replace(
        'fill="inherit"', ""
    )
    return "".join(
        f'<g transform="translate(0 {y}) rotate({turn})">{shaft}{knobs}</g>'
        for turn in (-angle, angle)
    )


def biohazard(ink: str, size: float = 7.4) -> str:
    """Three crescents over a ring. `size` is the length of one unit of the construction.

    Proportions of 29 CFR 1910.145, figure (f)(8)(ii): discs of diameter 30, 11 from the centre,
    with holes of diameter 21, 15 from the centre, that open by 4.
    """

    def each(shape: str) -> str:
        return "".join(f'<g transform="rotate({turn})">{shape}</g>' for turn in (0, 120, 240))

    def discs(distance: float, radius: float) -> str:
        return each(f'<circle cx="0" cy="{-distance * size:.1f}" r="{radius * size:.1f}"/>')

    def slots(width: float, near: float, far: float) -> str:
        return each(
            f'<rect x="{-0.5 * width * size:.1f}" y="{-far * size:.1f}" '
            f'width="{width * size:.1f}" height="{(far - near) * size:.1f}"/>'
        )

    hole = f'<circle cx="0" cy="0" r="{3 * size:.1f}"/>'
    voids = discs(15, 10.5) + hole + slots(1, 0, 6) + slots(4, 20, 30)
    crescents = cut(ink, discs(11, 15), voids)
    name = f"cut{next(_IDS)}"
    clip = "".join(
        f'<circle cx="{15 * size * math.sin(turn):.1f}" cy="{-15 * size * math.cos(turn):.1f}" '
        f'r="{9.5 * size:.1f}"/>'
        for turn in (0, 2 * math.pi / 3, 4 * math.pi / 3)
    )
    ring = (
        f'<clipPath id="{name}">{clip}</clipPath><g clip-path="url(#{name})">'
        f'<circle cx="0" cy="0" r="{11 * size:.1f}" fill="none" stroke="{ink}" '
        f'stroke-width="{3.5 * size:.1f}"/></g>'
    )
    return f'<g transform="translate(0 40)">{crescents}{ring}</g>'


def trefoil(ink: str, radius: float = 31.0) -> str:
    """Disc of `radius` and three blades from 1.5 to 5 radii (49 CFR 172, appendix B)."""
    near, far = 1.5 * radius, 5 * radius
    cos = 0.75**0.5
    blade = (
        f"M{-near / 2} {near * cos:.1f} A{near} {near} 0 0 0 {near / 2} {near * cos:.1f} "
        f"L{far / 2} {far * cos:.1f} A{far} {far} 0 0 1 {-far / 2} {far * cos:.1f} Z"
    )
    blades = "".join(path(blade, f'transform="rotate({turn})"') for turn in (0, 120, 240))
    return f'<g fill="{ink}"><circle cx="0" cy="0" r="{radius}"/>{blades}</g>'


def bomb(ink: str, hand: int) -> str:
    """Bursting bomb with fragments."""
    turns = ((-75, -45, -20, 8, 35, 60, 85), (-84, -58, -30, -6, 22, 48, 80))[hand]
    tips = ((155, 160, 145, 195, 150, 160, 140), (150, 176, 150, 186, 160, 178, 150))[hand]
    rays = "".join(
        path(f"M-18 -80 L0 {-tip} L18 -80 Z", f'transform="rotate({turn})"')
        for turn, tip in zip(turns, tips, strict=True)
    )
    shards = "".join(
        path(f"M-15 {-r} l30 -8 l6 30 l-28 6 Z", f'transform="rotate({turn})"')
        for turn, r in (
            *((-98, 175), (-60, 165), (-32, 182), (-6, 150), (21, 180)),
            *((47, 176), (73, 168), (104, 172)),
        )
    )
    ground = path("M-100 130 h200 l24 22 h-248 Z")
    return (
        f'<g fill="{ink}"><circle cx="0" cy="32" r="{(84, 74)[hand]}"/>{rays}{shards}{ground}</g>'
    )


def corrosion(ink: str, hand: int) -> str:
    """Liquids spill from two vessels onto a metal and a hand."""
    tube = path("M0 -25 H150 V-33 H166 V33 H150 V25 H0 A25 25 0 0 1 0 -25 Z")
    glass = path("M18 -13 H138 V-2 H18 Z") if hand == 0 else path("M14 -14 H140 V14 H14 Z")
    places = (
        "translate(-37 -130) rotate(142)",
        f"translate(37 -130) rotate({(38, 30)[hand]}) scale(1 -1)",
    )
    tubes = "".join(f'<g transform="{p}">{tube}</g>' for p in places)
    voids = "".join(f'<g transform="{p}">{glass}</g>' for p in places)
    drops = "".join(
        path(f"M{x} {y} q16 28 0 42 q-16 -14 0 -42 Z")
        for x, y in ((-172, -8), (-160, 42), (172, -8), (160, 42))
    )
    metal = path(
        "M-320 98 H-204 Q-200 124 -182 118 Q-166 132 -152 120 Q-134 124 -128 98 H-54 V138 H-320 Z"
    )
    skin = path(
        "M322 84 L242 72 Q212 66 198 82 Q180 108 162 100 Q146 106 134 88 L76 96 Q52 102 60 118 "
        "L140 122 L102 126 Q84 132 92 148 L204 150 Q262 146 322 130 Z"
    )
    return cut(ink, tubes + drops + metal + skin, voids)


def division(ink: str, text: str, font: int) -> str:
    """Division of class 1 in large digits, instead of a symbol."""
    weight, stretch = ((0.03, 1.0), (0.05, 1.12), (0.02, 1.25))[font]
    return words(text, 0, 92, 180, ink, font=FONTS[font], weight=weight, stretch=stretch)


def fissile(ink: str, font: int) -> str:
    """The word FISSILE, instead of a symbol."""
    return words("FISSILE", 0, 120, 112, ink, font=FONTS[font], stretch=1.08)
