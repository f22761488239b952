"""Drawings of the optional marks of the IMDG Code, as SVG.

Layouts follow the code's figures: 3.4.5.2 limited quantities, 5.2.1.6.3 environmentally hazardous,
5.3.2.2 elevated temperature, 5.5.2.3.2 fumigation warning and 5.2.1.10.2 lithium batteries. All are
original drawings.
"""

from drawing import BLACK, WHITE, rect, words
from marker_symbols import skull_crossed
from sticker_plates import RED, fitted, line, path, svg

_DIAMOND = "M500 0 L1000 500 L500 1000 L0 500 Z"


def limited_quantity() -> str:
    """Diamond with black upper and lower parts."""
    body = path(_DIAMOND, WHITE) + path("M500 0 L745 245 H255 Z M500 1000 L255 755 H745 Z", BLACK)
    return svg(1000, 1000, body + line("M500 26 L974 500 L500 974 L26 500 Z", BLACK, 36))


def environmentally_hazardous() -> str:
    """Diamond with a dead fish and a bare tree."""
    frame = path(_DIAMOND, WHITE) + line("M500 60 L940 500 L500 940 L60 500 Z", BLACK, 22)
    trunk = path("M398 655 Q420 520 404 380 L426 300 L446 390 Q452 530 500 655 Z", BLACK)
    twigs = "M424 400 L340 300 M424 400 L480 250 M440 460 L570 340 M412 470 L300 420 M424 330 V220"
    tree = trunk + line(twigs, BLACK, 24) + line("M480 285 L540 250 M350 312 L300 310", BLACK, 14)
    fish = path("M470 640 Q600 500 730 590 L800 530 L790 690 L728 640 Q600 720 470 640 Z", BLACK)
    eye = line("M530 610 L556 636 M556 610 L530 636", WHITE, 10)
    water = line("M250 690 H770", BLACK, 26) + line("M300 726 H700", BLACK, 12)
    return svg(1000, 1000, frame + tree + fish + eye + water)


def elevated_temperature() -> str:
    """Triangle with a red border around a thermometer; it fills the drawing."""
    body = path("M500 0 L1000 866 H0 Z", RED) + path("M500 124 L893 804 H107 Z", WHITE)
    body += f'<circle cx="500" cy="690" r="68" fill="{RED}"/>' + rect(478, 390, 44, 300, RED)
    body += line("M440 650 V360 A60 60 0 0 1 560 360 V650", RED, 18)
    ticks = "".join(f"M580 {y} h60 " for y in (400, 460, 520, 580))
    return svg(1000, 866, body + line(ticks, RED, 18))


def fumigation_warning() -> str:
    """Panel with a skull and the words of the code; gas and dates look written by hand."""
    body = rect(0, 0, 1000, 750, WHITE) + rect(
        18, 18, 964, 714, "none", f'stroke="{BLACK}" stroke-width="36"'
    )
    skulls = "".join(
        f'<g transform="translate({x} 130) scale(0.42)">{skull_crossed(BLACK)}</g>'
        for x in (150, 850)
    )
    body += skulls + fitted("DANGER", 500, 165, 105, BLACK, 430)
    body += fitted("THIS UNIT IS UNDER FUMIGATION", 500, 270, 50, BLACK, 880)
    body += words("WITH", 140, 370, 40, BLACK) + words("APPLIED ON", 205, 460, 40, BLACK)
    body += words("VENTILATED ON", 238, 550, 40, BLACK)
    rules = "M220 376 H920 M350 466 H920 M420 556 H920"
    pen = "M260 360 q30 -50 60 -10 t60 -14 t50 8 t70 -20 "
    pen += "M400 448 l30 -40 m20 40 l40 -44 q30 50 60 4"
    body += line(rules, BLACK, 6) + line(pen, "#24379a", 11)
    return svg(1000, 750, body + words("DO NOT ENTER", 500, 680, 84, BLACK))


def lithium_battery() -> str:
    """White square with a hatched red edge, batteries and a flame."""
    hatch = "".join(
        f"M{x} {y} l44 44 "
        for i in range(17)
        for x, y in ((58 * i + 8, 8), (58 * i + 8, 948), (8, 58 * i + 8), (948, 58 * i + 8))
    )
    body = rect(0, 0, 1000, 1000, WHITE) + line(hatch, RED, 26)
    cells = "".join(
        rect(x, 360, 120, 260, BLACK) + rect(x + 35, 330, 50, 30, BLACK) for x in (240, 390)
    )
    broken = path("M560 360 H620 L600 430 L650 470 L610 540 L640 620 H560 Z", BLACK)
    flame = "M690 610 Q640 500 720 440 Q716 500 760 520 Q780 470 760 400 Q860 500 800 610 Z"
    body += cells + broken + path(flame, BLACK)
    return svg(1000, 1000, body + words("UN 3480", 500, 800, 110, BLACK))


MARKS = {
    # name: (drawing, (width, height) in mm, faces; none stands for those with markers)
    "limited_quantity": (limited_quantity(), (354, 354), []),
    "environmentally_hazardous": (environmentally_hazardous(), (354, 354), []),
    "elevated_temperature": (elevated_temperature(), (250, 217), []),
    "fumigation_warning": (fumigation_warning(), (400, 300), ["door"]),
    "lithium_battery": (lithium_battery(), (200, 200), []),
}
"""Smallest sizes are those of the code on containers; sides of diamonds and triangle are 250 mm."""
