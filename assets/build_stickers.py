"""Draw plates, stickers and invented brand emblems as SVG and convert them to PNG.

    python assets/build_stickers.py

Run by hand. They appear next to the markers and have no label. All drawings, names and owner codes
are invented.
"""

import json

import cv2
from build_markers import ASSETS, BLACK, WHITE, bake, words

SILVER, DARK, YELLOW, GREEN = "#b9bcbf", "#2a2c2e", "#f2c200", "#1c7a3c"


def rect(x: float, y: float, w: float, h: float, fill: str, more: str = "") -> str:
    return f'<rect x="{x}" y="{y}" width="{w}" height="{h}" fill="{fill}" {more}/>'


def svg(width: int, height: int, body: str) -> str:
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
    return f'{head} preserveAspectRatio="none">\n{body}\n</svg>\n'


def lines(
    x: float, y: float, widths: list[int], step: float, color: str, height: float = 12
) -> str:
    return "".join(rect(x, y + i * step, w, height, color) for i, w in enumerate(widths))


def safety_plate() -> str:
    body = rect(0, 0, 1000, 600, SILVER) + rect(
        20, 20, 960, 560, "none", f'stroke="{DARK}" stroke-width="8"'
    )
    body += words("CSC SAFETY APPROVAL", 500, 110, 60, DARK)
    return svg(1000, 600, body + lines(70, 170, [820, 640, 760, 520, 800, 690], 62, DARK, 22))


def owner_plate() -> str:
    body = rect(0, 0, 1000, 700, "#d8d2b8") + words("OWNER", 500, 120, 80, DARK)
    return svg(1000, 700, body + lines(80, 200, [840, 700, 760, 500, 620], 90, DARK, 26))


def customs_plate() -> str:
    body = rect(0, 0, 1000, 400, SILVER) + words("APPROVED FOR TRANSPORT", 500, 130, 58, DARK)
    body += words("UNDER CUSTOMS SEAL", 500, 220, 58, DARK)
    return svg(1000, 400, body + lines(200, 290, [600], 40, DARK, 30))


def height_triangle() -> str:
    body = rect(0, 0, 1000, 1000, YELLOW)
    body += f'<path d="M0 0 L1000 0 L0 1000 Z" fill="{BLACK}"/>' + words(
        "2.9 M", 640, 760, 130, BLACK
    )
    return svg(1000, 1000, body + words("HC", 300, 300, 190, YELLOW))


def height_sign() -> str:
    body = rect(0, 0, 1000, 700, YELLOW) + rect(
        25, 25, 950, 650, "none", f'stroke="{BLACK}" stroke-width="30"'
    )
    return svg(
        1000, 700, body + words("2.9 M", 500, 330, 200, BLACK) + words("9'6", 500, 590, 160, BLACK)
    )


def keep_dry() -> str:
    drops = "".join(
        f'<path d="M{x} 90 q34 60 0 90 q-34 -30 0 -90 Z" fill="{BLACK}"/>' for x in (300, 500, 700)
    )
    umbrella = f'<path d="M150 520 A350 300 0 0 1 850 520 Z" fill="{BLACK}"/>'
    handle = f'<path d="M500 500 V800 A60 60 0 0 1 380 800" fill="none" stroke="{BLACK}" stroke-width="30"/>'
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + drops + umbrella + handle)


def fork_here() -> str:
    fork = (
        rect(180, 180, 70, 560, BLACK)
        + rect(180, 700, 640, 70, BLACK)
        + rect(330, 250, 430, 400, BLACK)
    )
    return svg(1000, 1000, rect(0, 0, 1000, 1000, "#ffffff") + fork)


def no_walking() -> str:
    figure = f'<circle cx="500" cy="270" r="60" fill="{BLACK}"/>' + rect(450, 350, 100, 240, BLACK)
    legs = f'<path d="M470 580 L400 780 M530 580 L600 780" stroke="{BLACK}" stroke-width="50"/>'
    ban = '<circle cx="500" cy="500" r="400" fill="none" stroke="#c81e2a" stroke-width="70"/>'
    bar = '<path d="M220 220 L780 780" stroke="#c81e2a" stroke-width="70"/>'
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + figure + legs + ban + bar)


def diamond(fill: str, inner: str) -> str:
    return svg(1000, 1000, f'<path d="M500 0 L1000 500 L500 1000 L0 500 Z" fill="{fill}"/>{inner}')


def limited_quantity() -> str:
    tips = f'<path d="M500 0 L750 250 H250 Z M500 1000 L250 750 H750 Z" fill="{BLACK}"/>'
    edge = f'<path d="M500 20 L980 500 L500 980 L20 500 Z" fill="none" stroke="{BLACK}" stroke-width="30"/>'
    return diamond(WHITE, tips + edge)


def company_diamond() -> str:
    edge = f'<path d="M500 70 L930 500 L500 930 L70 500 Z" fill="none" stroke="{WHITE}" stroke-width="24"/>'
    return diamond("#7a2a8c", edge + words("VK", 500, 610, 260, WHITE))


def timber() -> str:
    body = rect(0, 0, 1000, 500, "#cdbb8f") + words(
        "TIMBER COMPONENT TREATMENT", 500, 130, 50, DARK
    )
    return svg(1000, 500, body + lines(120, 200, [760, 560, 660], 90, DARK, 36))


def washed() -> str:
    body = rect(0, 0, 1000, 600, GREEN) + words("CLEANED", 500, 260, 150, WHITE)
    return svg(1000, 600, body + words("FOOD GRADE", 500, 450, 100, WHITE))


def code_tag() -> str:
    cells = "".join(
        rect(120 + 40 * x, 120 + 40 * y, 40, 40, BLACK)
        for x in range(19)
        for y in range(19)
        if (x * 7 + y * 11 + x * y * 3 + (x ^ y)) % 3 == 0 or (x < 6 and y < 6 and (x + y) % 2 == 0)
    )
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + cells)


SIDES = ["front", "back"]
ENDS = ["door", "no_door"]

STICKERS = {
    # name: (drawing, (width, height) in mm, faces, present on every container)
    "csc_safety_approval": (safety_plate(), (250, 150), ["door"], True),
    "owner_plate": (owner_plate(), (200, 140), ["door"], True),
    "customs_plate": (customs_plate(), (250, 100), ["door"], False),
    "timber_treatment": (timber(), (200, 100), ["door"], False),
    "height_triangle": (height_triangle(), (300, 300), [*SIDES, "no_door"], False),
    "height_sign": (height_sign(), (250, 175), [*SIDES, *ENDS], False),
    "keep_dry": (keep_dry(), (220, 220), [*SIDES, *ENDS], False),
    "fork_here": (fork_here(), (240, 240), SIDES, False),
    "no_walking": (no_walking(), (250, 250), ENDS, False),
    "limited_quantity": (limited_quantity(), (350, 350), [*SIDES, *ENDS], False),
    "company_diamond": (company_diamond(), (330, 330), [*SIDES, *ENDS], False),
    "washed": (washed(), (180, 110), ["door"], False),
    "code_tag": (code_tag(), (160, 160), [*SIDES, *ENDS], False),
}


def emblem(body: str) -> str:
    return svg(1000, 1000, f'<g fill="{WHITE}" stroke="none">{body}</g>')


def star(points: int, outer: float, inner: float) -> str:
    from math import cos, pi, sin

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


def main() -> None:
    """Write stickers/*.svg, *.png, index.json and brands.json."""
    folder = ASSETS / "stickers"
    folder.mkdir(exist_ok=True)
    index = {}
    drawings = {name: (text, "sticker") for name, (text, *_) in STICKERS.items()}
    drawings |= {f"emblem_{name}": (emblem(body), "emblem") for name, body in EMBLEMS.items()}
    for name, (text, role) in drawings.items():
        (folder / f"{name}.svg").write_text(text, encoding="utf-8")
        cv2.imwrite(str(folder / f"{name}.png"), bake(text), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        _, size, where, always = STICKERS.get(name, ("", (1000, 1000), [], False))
        index[name] = {"role": role, "size_mm": list(size), "where": where, "always": always}
    (folder / "index.json").write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")
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
