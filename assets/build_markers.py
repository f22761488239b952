"""Draw the dangerous-goods markers, several prints of each of the 26 classes, as PNG.

    python assets/build_markers.py

Run by hand. A marker is a square standing on its corner, inscribed in 1000 x 1000. Class, symbol and
colours come from `marker_families.py`. Wording, weight of the digit, inner line, rim and inks are
distributed alike over all fields, and are the same for classes with equal fields, so only field,
symbol and digit tell a class. All are original drawings after the rules, which leave these choices
to the printer.
"""

import json
from dataclasses import dataclass

import cv2
from drawing import ASSETS, BLACK, FONTS, WHITE, bake, rect, width_of, words
from marker_families import FAMILIES, PALETTE, SMALL_PRINT, Family
from marker_fittings import FITTINGS

WORDINGS = ("none", "line", "un", "two", "side", "fine")
"""Wordings of all prints except the first of a class, which is "heavy"."""

DIGITS = (175, 150, 175, 160, 95)
"""Heights of the class digit's capitals; most are heavy."""

RIMS = (0, 26, 0, 44)
INNER_LINES = ("solid", "thin", "dotted", "none", "bold")
COMMON = ("C1.2", "C2.1", "C2.2", "C2.3", "C2.4", "C3.1", "C3.2", "C4.3", "C4.4", "C5.1")
"""Classes with six prints; the others have four, because all prints share a texture array."""


@dataclass(frozen=True)
class Look:
    """Choices of one print.

    Attributes:
        wording: One of WORDINGS: one bold line, none, one regular line, UN number, two bold lines,
            a second line in small letters beside the first, heading with small print.
        digit: Height of the class digit, an item of DIGITS.
        rim: Width of the white rim.
        line: One of INNER_LINES.
        ink: Index into the inks of PALETTE.
        font: Index into FONTS.
        pick: Number of the print, which selects symbol, UN number, letter and small print.
    """

    wording: str
    digit: float
    rim: float
    line: str
    ink: int
    font: int
    pick: int


def looks(number: int, count: int) -> list[Look]:
    """Return the looks of a class: a Latin square, so that choices are independent of the field.

    Args:
        number: Number of the field.
        count: Number of prints of the class.
    """
    return [
        Look(
            WORDINGS[(v + 4 * number + number // 3) % len(WORDINGS)] if v else "heavy",
            DIGITS[(2 * v + number) % len(DIGITS)],
            RIMS[(v + 3 * number + v // 4) % len(RIMS)],
            INNER_LINES[(v + 3 * number) % len(INNER_LINES)],
            (v + number) % 3,
            (v + number // 3) % len(FONTS),
            v,
        )
        for v in range(count)
    ]


@dataclass(frozen=True)
class Line:
    """One centred line of words: text, height of the capitals, baseline, and style of the letters."""

    text: str
    y: float
    height: float
    stretch: float = 1.0
    weight: float = 0.0
    spacing: float = 0.0

    def width(self, font: str) -> float:
        return self.stretch * width_of(self.text, self.height, font, self.spacing)

    def svg(self, x: float, ink: str, font: str) -> str:
        return words(
            *(self.text, x, self.y, self.height, ink),
            **{"font": font, "stretch": self.stretch, "weight": self.weight},
            spacing=self.spacing,
        )


def diamond(margin: float) -> str:
    near, far = margin, 1000 - margin
    return f"M500 {near:g} L{far:g} 500 L500 {far:g} L{near:g} 500 Z"


class Print:
    """One marker while it is drawn."""

    def __init__(self, family: Family, look: Look) -> None:
        self.family, self.look = family, look
        self.font = FONTS[look.font]
        self.margin = 50 + 0.5 * look.rim
        self.top = 462.0 if family.second_shape in ("", "stripes") else 516.0
        self.bare = look.wording == "none"
        self.dark_diamond = family.inhalation and look.pick % 2 == 1
        self.small, self.large = family.short, family.long
        if self.dark_diamond:
            self.small, self.large = "INHALATION HAZARD", "INHALATION|HAZARD"
        height = look.digit * (0.78 if len(family.digit) > 1 else 1.0)
        if family.letters or family.underlined or (family.bars and look.wording == "un"):
            height = min(height, 135)
        self.digit = Line(family.digit, 0, height, 1.12, 0.05 if height > 100 else 0.0)
        half = self.digit.width(self.font) / 2
        self.digit_y = 1000 - self.margin - 24 - half - (20 if family.underlined else 0)
        self.floor = self.digit_y - height - 34

    def room(self, y: float) -> float:
        """Return the width within the inner line at a height in the lower half."""
        return 2 * (1000 - self.margin - 24 - max(y, 500))

    def svg(self) -> str:
        family, look = self.family, self.look
        body = self.wording()
        index = (look.pick + look.ink) % len(family.symbols)
        y, scale = (345, 1.12) if self.bare else (282, 0.88)
        if look.wording == "un":
            y, scale = 262, 0.76
        ink = family.symbol_ink or family.ink
        if self.dark_diamond:
            y, scale, ink = (
                (self.margin + 215, 0.68, WHITE) if self.bare else (self.margin + 190, 0.6, WHITE)
            )
        symbol = family.symbols[index](ink)
        digit = self.digit
        number = Line(digit.text, self.digit_y, digit.height, digit.stretch, digit.weight)
        line = ""
        if family.underlined:
            half = digit.width(self.font) / 2 + 10
            line = rect(500 - half, self.digit_y + 10, 2 * half, 10, family.ink)
        return (
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 1000">\n'
            f'<clipPath id="outer"><path d="{diamond(0)}"/></clipPath>'
            f'<clipPath id="field"><path d="{diamond(look.rim)}"/></clipPath>'
            f'<clipPath id="inner"><path d="{diamond(self.margin)}"/></clipPath>'
            '<clipPath id="upper"><rect width="1000" height="500"/></clipPath>\n'
            f'<g clip-path="url(#outer)"><rect width="1000" height="1000" fill="{WHITE}"/>'
            f'<g clip-path="url(#field)">{self.field()}{self.inner_line()}</g>'
            f'<g transform="translate(500 {y}) scale({scale})">{symbol}</g>'
            f"{body}{number.svg(500, family.ink, self.font)}{line}</g>\n</svg>\n"
        )

    def field(self) -> str:
        family, ink = self.family, self.look.ink
        base = rect(0, 0, 1000, 1000, PALETTE[family.field][ink])
        second = BLACK if family.second == "black" else PALETTE.get(family.second, [""] * 3)[ink]
        shape = family.second_shape
        if shape == "lower":
            base += rect(0, 500, 1000, 500, second)
        elif shape.endswith("bordered"):
            y = 0 if shape.startswith("upper") else 500
            base += f'<g clip-path="url(#inner)">{rect(0, y, 1000, 500, second)}</g>'
        elif shape.endswith("stripes"):
            height = 500 if shape.startswith("half") else 1000
            width = 1000 / 15
            bars = "".join(rect((2 * i + 1) * width, 0, width, height, second) for i in range(7))
            base += f'<g clip-path="url(#inner)">{bars}</g>'
        if self.dark_diamond:
            tip, half = self.margin, 215 if self.bare else 190
            base += (
                f'<path fill="{BLACK}" d="M500 {tip} l{half} {half} l{-half} {half} '
                f'l{-half} {-half} Z"/>'
            )
        return base

    def inner_line(self) -> str:
        """Return the inner line; its halves have the colours of symbol and digit (5.2.2.2.1.1.2)."""
        width = {"solid": 12, "thin": 6, "dotted": 9, "none": 0, "bold": 18}[self.look.line]
        if not width:
            return ""
        dots = ' stroke-dasharray="1 24" stroke-linecap="round"' if width == 9 else ""
        line, family = diamond(self.margin), self.family
        return (
            f'<g fill="none" stroke-width="{width}"{dots}><path d="{line}" stroke="{family.ink}"/>'
            f'<path d="{line}" stroke="{family.symbol_ink or family.ink}" '
            'clip-path="url(#upper)"/></g>'
        )

    def wording(self) -> str:
        """Return everything between symbol and digit."""
        kind = self.look.wording
        floor = self.floor - (86 if self.family.letters else 0)
        floor -= 62 if self.has_box() else 0
        one, two = self.small, self.large.split("|")
        body, end = "", 560.0 if self.bare else self.top
        if kind == "un":
            body, end = self.un_number()
            if self.look.pick % 2 and not self.family.bars:
                line = self.fitted(self.large.replace("|", " "), end + 16, 40, 600)
                body, end = body + self.row(line), line.y
        elif kind == "line":
            line = self.fitted(self.large.replace("|", " "), self.top + 44, 64, 600, spacing=0.1)
            body, end = self.row(line, self.family.bars), line.y
        elif kind == "heavy":
            line = self.fitted(one, self.top + 8, 120, 600, stretch=1.25, weight=0.06)
            body, end = self.row(line, self.family.bars), line.y
        elif kind == "two":
            height = 100.0
            while True:
                lines = [
                    Line(text, self.top + height * (1 + 1.26 * i), height, 1.12, 0.04)
                    for i, text in enumerate(two)
                ]
                wide = [line.width(self.font) for line in lines]
                bars = self.bars_width(height, self.family.bars)
                if (
                    max(wide) < 610
                    and wide[1] + bars < self.room(lines[1].y)
                    and lines[1].y < floor
                ):
                    break
                height -= 2
            body = self.row(lines[0]) + self.row(lines[1], self.family.bars)
            end = lines[1].y
        elif kind == "side":
            body, end = self.beside(two)
        elif kind == "fine":
            line = self.fitted(one, self.top, 84, 560, stretch=1.2, weight=0.05)
            body, end = self.row(line, self.family.bars), line.y
            step = 28
            rows = 2 if self.family.letters else 4
            for i in range(rows):
                text = SMALL_PRINT[(4 * self.look.pick + i) % len(SMALL_PRINT)]
                y = end + 14 + step * (i + 1)
                if y < floor + 10:
                    body += Line(text, y, 18, 1.1).svg(500, self.family.ink, self.font)
            end += 14 + rows * step
        if kind in ("none", "un") and self.family.bars:
            height = 92 if self.bare else 58
            y = end + 14 + height
            body += self.bars(500 - self.bars_width(height, self.family.bars) / 2, y, height)
            end = y
        return self.plate() + body + self.extras(end)

    def fitted(
        self,
        text: str,
        top: float,
        height: float,
        width: float,
        stretch: float = 1.0,
        weight: float = 0.0,
        spacing: float = 0.0,
    ) -> Line:
        """Return a line below `top` at most `height` tall and `width` wide."""
        found = Line(text, 0, height, stretch, weight, spacing).width(self.font)
        found += self.bars_width(height, self.family.bars if self.look.wording != "un" else 0)
        height *= min(1.0, width / found)
        return Line(text, top + height, height, stretch, weight, spacing)

    def row(self, line: Line, bars: int = 0) -> str:
        """Return a line with red bars behind it."""
        extra = self.bars_width(line.height, bars)
        text = line.svg(500 - extra / 2, self.family.ink, self.font)
        x = 500 - extra / 2 + line.width(self.font) / 2 + 0.3 * line.height
        return text + (self.bars(x, line.y, line.height) if bars else "")

    def bars_width(self, height: float, bars: int) -> float:
        return bars * 0.55 * height + 0.1 * height if bars else 0.0

    def bars(self, x: float, y: float, height: float) -> str:
        red = PALETTE["red"][self.look.ink]
        return "".join(
            rect(x + 0.55 * height * i, y - 1.1 * height, 0.32 * height, 1.2 * height, red)
            for i in range(self.family.bars)
        )

    def beside(self, two: list[str]) -> tuple[str, float]:
        """Return the first line with the second one in small letters beside it."""
        small = two[1].split(" ")
        height = 130.0
        while True:
            first = Line(two[0], self.top + 26 + height, height, 1.15, 0.05)
            size = 0.36 * height
            rest = [
                Line(word, first.y - (len(small) - 1 - i) * 1.5 * size, size, 1.2, 0.03)
                for i, word in enumerate(small)
            ]
            tail = max(line.width(self.font) for line in rest)
            bars = self.bars_width(height, self.family.bars)
            total = first.width(self.font) + 0.25 * height + tail + bars
            if total < 640:
                break
            height -= 2
        x = 500 - total / 2
        body = first.svg(x + first.width(self.font) / 2, self.family.ink, self.font)
        x += first.width(self.font) + 0.25 * height
        for line in rest:
            body += line.svg(x + line.width(self.font) / 2, self.family.ink, self.font)
        if bars:
            body += self.bars(x + tail + 0.2 * height, first.y, height)
        return body, first.y

    def un_number(self) -> tuple[str, float]:
        """Return the UN number on a white band (49 CFR 172.332)."""
        number = self.family.un[self.look.pick % len(self.family.un)]
        half = 300 if self.look.rim else 330
        body = rect(500 - half, 436, 2 * half, 128, WHITE, f'stroke="{BLACK}" stroke-width="8"')
        return body + Line(number, 546, 92, 1.3, 0.03).svg(500, BLACK, self.font), 564

    def plate(self) -> str:
        """Return the white plate that some prints have behind words on stripes."""
        if self.family.second_shape != "stripes" or self.look.wording in ("none", "un"):
            return ""
        return rect(170, 448, 660, 160, WHITE) if self.look.pick % 2 else ""

    def has_box(self) -> bool:
        shown = ("line", "heavy", "side") if self.family.bars else ("line", "heavy", "side", "none")
        return self.family.boxed and self.look.wording in shown

    def extras(self, end: float) -> str:
        """Return compatibility letter and index box below the words, which reach down to `end`."""
        family, body = self.family, ""
        if family.letters:
            text = family.letters[self.look.pick % len(family.letters)]
            top = end + 18
            height = max(min(120 if self.bare else 84, self.floor + 12 - top), 40)
            body += Line(text, top + height, height, 1.1, 0.04).svg(500, family.ink, self.font)
        if self.has_box():
            top = end + 18 if end < self.floor - 70 else self.floor - 56
            body += rect(380, top, 240, 52, "none", f'stroke="{BLACK}" stroke-width="6"')
            body += words("INDEX", 430, top + 34, 18, BLACK)
        return body


def all_looks() -> dict[str, tuple[str, Look]]:
    """Return class and look of every print by name. The first of a class has the class's name."""
    fields = {
        name: (each.field, each.ink, each.second, each.second_shape)
        for name, each in FAMILIES.items()
    }
    numbers = list(dict.fromkeys(fields.values()))
    return {
        class_name if look.pick == 0 else f"{class_name}.{look.pick}": (class_name, look)
        for class_name, field in fields.items()
        for look in looks(numbers.index(field), 6 if class_name in COMMON else 4)
    }


def main() -> None:
    """Write markers/*.png, markers/index.json and markers/un_numbers.json."""
    folder = ASSETS / "markers"
    folder.mkdir(exist_ok=True)
    index = {}
    for name, (class_name, look) in all_looks().items():
        image = bake(Print(FAMILIES[class_name], look).svg())
        cv2.imwrite(str(folder / f"{name}.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
        index[name] = {"class": class_name, "wording": look.wording}
    for name, svg in FITTINGS.items():
        cv2.imwrite(str(folder / f"{name}.png"), bake(svg), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        index[name] = {"class": "", "wording": ""}
    un = {name: [family.hazard_number, list(family.un)] for name, family in FAMILIES.items()}
    for name, about in (("index.json", index), ("un_numbers.json", un)):
        (folder / name).write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
