"""Draw plates, stickers, marks, crayon marks and invented emblems, and write them as SVG and PNG.

    python assets/build_stickers.py

Run by hand; needs fastgen. Stickers have no label; marks have one where a configuration switches them on. All
drawings, names and owner codes are invented.
"""

import json
from dataclasses import asdict, fields
from math import cos, pi, sin
from typing import Any

import cv2
from crayon_marks import CRAYON
from drawing import ASSETS, BLACK, WHITE, bake
from mark_drawings import MARKS
from sticker_plates import (
    GREEN,
    RED,
    code_tag,
    customs_plate,
    fork_here,
    keep_dry,
    no_walking,
    owner_plate,
    safety_plate,
    svg,
    timber_treatment,
    washed,
)
from sticker_signs import (
    anchor,
    caution_doors,
    caution_load,
    height_sign,
    height_triangle,
    ic_mark,
    seal,
    sextant,
    star_shield,
    super_heavy,
    width_sign,
)
from sticker_traces import (
    chalk,
    customs_seal,
    diamond_logo,
    inspection_label,
    leasing_logo,
    overpaint,
    residue,
    square_logo,
    streaks,
)

from fastgen.decals.artwork import Sticker

SIDES = ("front", "back")
ENDS = ("door", "no_door")
WALLS = (*SIDES, *ENDS)
STANDARD, HIGH = ("20", "40"), ("40HC", "45HC")
LOW_LEFT = (0.0, 0.4, 0.0, 0.35)
UPPER_RIGHT = (0.7, 1.0, 0.45, 0.95)
NAVY, ORANGE, SKY = "#12305c", "#d9541e", "#2f9ad0"


Entry = tuple[str, Sticker]
"""SVG of a sticker, and how `sampling/stickers.py` places it. Its name is the key in STICKERS."""


def _one(drawing: str, size: tuple[float, float], where: tuple[str, ...], **more: Any) -> Entry:
    """Return a sticker.

    Args:
        drawing: SVG.
        size: Width and height in mm.
        where: Faces that may carry it.
        more: Further fields of Sticker.
    """
    return drawing, Sticker("", size, where, **more)


def _sized(metres: str, feet: str, kinds: tuple[str, ...]) -> Entry:
    """Return the height sign beside the identifier; most containers have it on their sides."""
    drawing = height_sign(metres, feet)
    return _one(drawing, (140, 180), WALLS, share=0.45, kinds=kinds, place=UPPER_RIGHT)


def _ic(number: str) -> Entry:
    """Return the mark of a railway in the colour of the lettering."""
    how = {"weight": 0.0, "share": 0.4, "place": UPPER_RIGHT, "ink": "lettering", "group": "ic"}
    return _one(ic_mark(number), (190, 190), SIDES, **how)


def _few(drawing: str, size: tuple[float, float], where: tuple[str, ...], **more: Any) -> Entry:
    """Return a sticker of a family with several drawings, each rarer than a single sticker."""
    return _one(drawing, size, where, weight=0.5, **more)


WAVES = "M120 300 q190 -150 380 0 t380 0 v120 q-190 150 -380 0 t-380 0 Z M120 560 q190 -150 380 0 t380 0 v90 q-190 150 -380 0 t-380 0 Z"
PEAK = "M120 720 L400 180 L560 470 L640 340 L880 720 Z"
LOOPS = "M500 120 a300 300 0 1 0 1 0 Z M500 250 a170 170 0 1 1 -1 0 Z"

STICKERS = {
    "csc_safety_approval": _one(safety_plate(), (250, 150), ("door",), always=True, place=LOW_LEFT),
    "owner_plate": _one(owner_plate(), (200, 140), ("door",), always=True, place=LOW_LEFT),
    "customs_plate": _one(customs_plate(), (250, 100), ("door",)),
    "timber_treatment": _one(timber_treatment(), (200, 100), ("door",)),
    "height_sign": _sized("2.9 m", "9'6\"", HIGH),
    "height_sign_standard": _sized("2.6 m", "8'6\"", STANDARD),
    "height_triangle": _one(height_triangle(), (300, 300), (*SIDES, "no_door"), kinds=HIGH),
    "width_sign": _one(width_sign(), (250, 120), WALLS, kinds=("45HC",)),
    "super_heavy_30": _few(super_heavy("30.5 t"), (280, 252), WALLS),
    "super_heavy_32": _few(super_heavy("32.5 t"), (280, 252), WALLS),
    "caution_load": _one(caution_load(), (270, 243), ("door",), share=0.2),
    "caution_doors": _few(caution_doors(), (200, 180), ENDS),
    **{f"ic_{number}": _ic(number) for number in ("27", "33", "61", "75", "83")},
    "seal_ostvik": _few(seal("OSTVIK REGISTER", NAVY, anchor(NAVY)), (150, 150), ("door",)),
    "seal_haldra": _few(seal("HALDRA MARITIME", RED, sextant(RED)), (150, 150), ("door",)),
    "seal_corvane": _few(seal("CORVANE BUREAU", GREEN, star_shield(GREEN)), (150, 150), ("door",)),
    "leasing_halvrik": _few(leasing_logo(BLACK, WHITE, "#f2c200", "HALVRIK"), (480, 200), WALLS),
    "leasing_quorda": _few(leasing_logo(WHITE, NAVY, SKY, "QUORDA"), (480, 200), WALLS),
    "leasing_boxmere": _few(leasing_logo("#f2c200", RED, BLACK, "BOXMERE"), (480, 200), WALLS),
    "line_waves": _few(square_logo(SKY, WHITE, WAVES, "NAVANTE"), (520, 520), WALLS),
    "line_peak": _few(square_logo(RED, WHITE, PEAK, "TOROVIK"), (520, 520), WALLS),
    "line_loop": _few(square_logo(WHITE, ORANGE, LOOPS, "OLVERA"), (520, 520), WALLS),
    "company_diamond": _few(diamond_logo("#7a2a8c", WHITE, "VK"), (330, 330), WALLS),
    "company_diamond_red": _few(diamond_logo(RED, WHITE, "NTL"), (330, 330), WALLS),
    "company_diamond_white": _few(diamond_logo(WHITE, NAVY, "OM"), (330, 330), WALLS),
    "keep_dry": _few(keep_dry(), (220, 220), WALLS),
    "fork_here": _few(fork_here(), (240, 240), SIDES),
    "no_walking": _few(no_walking(), (250, 250), ENDS),
    "washed": _one(washed(), (180, 110), ("door",)),
    "code_tag": _few(code_tag(), (160, 160), WALLS),
    "inspection_blue": _few(inspection_label(NAVY, "2027"), (110, 77), ("door",)),
    "inspection_red": _few(inspection_label(RED, "2026"), (110, 77), ("door",)),
    "customs_seal_blue": _few(
        customs_seal(NAVY, "CUSTOMS SEAL", "No 048 213"), (260, 78), ("door",)
    ),
    "customs_seal_green": _few(
        customs_seal(GREEN, "INSPECTED", "No 7715 20"), (260, 78), ("door",)
    ),
    "chalk_ring": _few(chalk("42", 3, True), (330, 260), WALLS),
    "chalk_letters": _few(chalk("AK7", 5, False), (420, 300), WALLS),
    "chalk_cross": _few(chalk("X", 8, True), (240, 240), WALLS),
    "chalk_digits": _few(chalk("274", 11, False), (380, 280), WALLS),
    "poster_residue_1": _few(residue(4, 0), (420, 340), WALLS),
    "poster_residue_2": _few(residue(9, 0), (300, 420), WALLS),
    "placard_residue": _one(residue(13, 4), (354, 354), WALLS),
    "overpaint_1": _few(overpaint(2), (400, 400), WALLS, ink="overpaint"),
    "overpaint_2": _few(overpaint(6), (400, 400), WALLS, ink="overpaint"),
}


def emblem(body: str) -> str:
    """Return the drawing of a brand's emblem, which takes the colour of the lettering."""
    return svg(1000, 1000, f'<g fill="{WHITE}" stroke="none">{body}</g>')


def star(points: int, outer: float, inner: float) -> str:
    """Return a star as a path; the radii alternate."""
    at = []
    for i in range(2 * points):
        r, a = (outer, inner)[i % 2], pi * i / points - pi / 2
        at.append(f"{500 + r * cos(a):.1f} {500 + r * sin(a):.1f}")
    return f'<path d="M{" L".join(at)} Z"/>'


EMBLEMS = {
    "wave": "".join(
        f'<path d="M60 {y} q220 -180 440 0 t440 0 v90 q-220 180 -440 0 t-440 0 Z"/>'
        for y in (260, 470, 680)
    ),
    "compass": star(4, 470, 130) + star(8, 250, 120),
    "rings": '<path fill-rule="evenodd" d="M500 40 a460 460 0 1 0 1 0 Z M500 160 a340 340 0 1 1 -1 0 Z '
    'M500 290 a210 210 0 1 0 1 0 Z"/>',
    "arrow": '<path d="M80 700 L500 120 L920 700 H700 L500 420 L300 700 Z"/><path d="M300 780 H700 V900 H300 Z"/>',
    "bars": "".join(
        f'<path d="M{120 + 200 * i} {760 - 160 * i} h150 V900 h-150 Z"/>' for i in range(4)
    ),
    "leaf": '<path d="M120 880 C100 380 420 100 900 100 C900 600 620 900 120 880 Z"/>',
    "sunrise": '<path d="M100 620 a400 400 0 0 1 800 0 Z"/><path d="M60 690 H940 V760 H60 Z M160 820 H840 V890 H160 Z"/>',
    "hexagon": '<path fill-rule="evenodd" d="M500 40 L900 270 V730 L500 960 L100 730 V270 Z '
    'M500 220 L250 365 V635 L500 780 L750 635 V365 Z"/>',
}

RUNS = {
    "run_wide_1": streaks(3, 7),
    "run_wide_2": streaks(5, 10),
    "run_wide_3": streaks(8, 5),
    "run_thin_1": streaks(11, 1),
    "run_thin_2": streaks(14, 2),
}

BRANDS = {
    "Varnholm": ("compass", ["VHLU", "VARU"], "VARNHOLM", ["VARNHOLM LINE", "NORTH ROUTE"]),
    "Tessaro": ("wave", ["TSRU", "TEOU"], "TESSARO", ["TESSARO MARINE", "TESSARO"]),
    "Kestrel Bay": ("arrow", ["KBYU", "KSBU"], "KESTREL BAY", ["KESTREL BAY", "SHORE TO SHORE"]),
    "Orlinde": ("rings", ["ORLU", "OLDU"], "ORLINDE", ["ORLINDE FREIGHT", "ORLINDE"]),
    "Quillmar": ("leaf", ["QLMU", "QMRU"], "QUILLMAR", ["QUILLMAR", "GREEN BOX"]),
    "Sundrake": ("sunrise", ["SDKU", "SNKU"], "SUNDRAKE", ["SUNDRAKE LOGISTICS", "SUNDRAKE"]),
    "Brevik Union": ("bars", ["BVUU", "BRVU"], "BREVIK UNION", ["BREVIK UNION", "DRY CARGO"]),
    "Hexalane": ("hexagon", ["HXLU", "HLNU"], "HEXALANE", ["HEXALANE", "SUPER HEAVY"]),
}


def _changed(sticker: Sticker) -> dict[str, object]:
    """Return size, faces, and the other fields that differ from their defaults."""
    usual = {each.name: each.default for each in fields(Sticker)}
    return {
        name: value
        for name, value in asdict(sticker).items()
        if name != "name" and value != usual[name]
    }


def main() -> None:
    """Write stickers/*.svg, *.png, index.json and brands.json."""
    folder = ASSETS / "stickers"
    folder.mkdir(exist_ok=True)
    index: dict[str, dict[str, object]] = {}
    drawings = {name: drawing for name, (drawing, _) in STICKERS.items()}
    for name, (_, sticker) in STICKERS.items():
        index[name] = {"role": "sticker", **_changed(sticker)}
    for name, (drawing, size, where) in MARKS.items():
        drawings[name] = drawing
        index[name] = {"role": "mark", "size_mm": size, "where": where}
    for name, body in EMBLEMS.items():
        drawings[f"emblem_{name}"] = emblem(body)
        index[f"emblem_{name}"] = {"role": "emblem", "size_mm": (1000, 1000)}
    for name, drawing in RUNS.items():
        drawings[name] = drawing
        index[name] = {"role": "run", "size_mm": (1000, 1000)}
    for name, drawing in CRAYON.items():
        drawings[name] = drawing
        index[name] = {"role": "crayon", "size_mm": (1000, 1000)}
    for old in folder.glob("*.*"):
        if old.stem not in drawings and old.suffix in (".svg", ".png"):
            old.unlink()
    for name, text in drawings.items():
        (folder / f"{name}.svg").write_text(text, encoding="utf-8")
        cv2.imwrite(str(folder / f"{name}.png"), bake(text), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(each)}" for name, each in index.items())
    (folder / "index.json").write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
    brands = {
        name: {
            "emblem": f"emblem_{mark}",
            "owner_codes": codes,
            "wordmark": word,
            "main_texts": texts,
        }
        for name, (mark, codes, word, texts) in BRANDS.items()
    }
    (folder / "brands.json").write_text(json.dumps(brands, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
