"""Drawings of plates and pictograms on containers, and SVG shapes that all stickers share."""

from drawing import BLACK, WHITE, rect, width_of, words

SILVER, DARK, YELLOW, GREEN, RED = "#b9bcbf", "#2a2c2e", "#f2c200", "#1c7a3c", "#c81e2a"


def svg(width: int, height: int, body: str) -> str:
    """Return a drawing of width x height units, stretched to the square of its texture."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
    return f'{head} preserveAspectRatio="none">\n{body}\n</svg>\n'


def path(d: str, fill: str, more: str = "") -> str:
    """Return a filled path."""
    return f'<path d="{d}" fill="{fill}" {more}/>'


def line(d: str, color: str, width: float, more: str = "") -> str:
    """Return a stroked path."""
    return f'<path d="{d}" fill="none" stroke="{color}" stroke-width="{width:g}" {more}/>'


def frame(width: float, height: float, color: str, stroke: float, inset: float) -> str:
    """Return the outline of a rectangle that lies `inset` units within a drawing."""
    inner = f'stroke="{color}" stroke-width="{stroke:g}"'
    return rect(inset, inset, width - 2 * inset, height - 2 * inset, "none", inner)


def fitted(text: str, x: float, y: float, height: float, color: str, width: float) -> str:
    """Return text centred on x with its baseline at y, lower if it would be wider than `width`."""
    return words(text, x, y, height * min(1.0, width / width_of(text, height)), color)


def bars(x: float, y: float, widths: list[int], step: float, color: str, height: float) -> str:
    """Return bars below one another that stand for lines of small print."""
    return "".join(rect(x, y + i * step, w, height, color) for i, w in enumerate(widths))


def safety_plate() -> str:
    body = rect(0, 0, 1000, 600, SILVER) + frame(1000, 600, DARK, 8, 20)
    body += words("CSC SAFETY APPROVAL", 500, 110, 60, DARK)
    return svg(1000, 600, body + bars(70, 170, [820, 640, 760, 520, 800, 690], 62, DARK, 22))


def owner_plate() -> str:
    body = rect(0, 0, 1000, 700, "#d8d2b8") + words("OWNER", 500, 120, 80, DARK)
    return svg(1000, 700, body + bars(80, 200, [840, 700, 760, 500, 620], 90, DARK, 26))


def customs_plate() -> str:
    body = rect(0, 0, 1000, 400, SILVER) + fitted("APPROVED FOR TRANSPORT", 500, 130, 58, DARK, 900)
    body += words("UNDER CUSTOMS SEAL", 500, 220, 58, DARK)
    return svg(1000, 400, body + bars(200, 290, [600], 40, DARK, 30))


def keep_dry() -> str:
    drops = "".join(path(f"M{x} 90 q34 60 0 90 q-34 -30 0 -90 Z", BLACK) for x in (300, 500, 700))
    umbrella = path("M150 520 A350 300 0 0 1 850 520 Z", BLACK)
    handle = line("M500 500 V800 A60 60 0 0 1 380 800", BLACK, 30)
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + drops + umbrella + handle)


def fork_here() -> str:
    fork = rect(180, 180, 70, 560, BLACK) + rect(180, 700, 640, 70, BLACK)
    load = rect(330, 250, 430, 400, BLACK)
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + fork + load)


def no_walking() -> str:
    figure = f'<circle cx="500" cy="270" r="60" fill="{BLACK}"/>' + rect(450, 350, 100, 240, BLACK)
    legs = line("M470 580 L400 780 M530 580 L600 780", BLACK, 50)
    ring = f'<circle cx="500" cy="500" r="400" fill="none" stroke="{RED}" stroke-width="70"/>'
    bar = line("M220 220 L780 780", RED, 70)
    return svg(1000, 1000, rect(0, 0, 1000, 1000, WHITE) + figure + legs + ring + bar)


def timber_treatment() -> str:
    body = rect(0, 0, 1000, 500, "#cdbb8f")
    body += fitted("TIMBER COMPONENT TREATMENT", 500, 130, 50, DARK, 900)
    return svg(1000, 500, body + bars(120, 200, [760, 560, 660], 90, DARK, 36))


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
