"""Colours, symbols, wordings and UN numbers of the markers of each class.

Sources: UN Model Regulations (IMDG Code) 5.2.2.2, ADR 5.2.2.2 and 5.3.2.2, 49 CFR 172.400 to
172.560. The UN numbers are entries of the dangerous goods list that belong to the class.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import marker_symbols as symbols
from drawing import BLACK, WHITE

PALETTE = {
    # three inks of each colour: as specified, another printer's, faded
    "red": ("#d2202e", "#e4411f", "#c03a4c"),
    "green": ("#00823f", "#1c8576", "#3d8f63"),
    "blue": ("#0057a8", "#1f2f8a", "#6a72b8"),
    "blue under black": ("#0f6cbd", "#3a66c0", "#7f88c8"),
    "orange": ("#f07d1a", "#e8601c", "#f29a4a"),
    "yellow": ("#f6c900", "#f2dc1e", "#e6ab23"),
    "white": ("#ffffff", "#f3f0e4", "#e8eaf3"),
}

Symbol = Callable[[str], str]


@dataclass(frozen=True)
class Family:
    """Everything that tells the markers of one class from those of another.

    Attributes:
        field: Colour of the field, a key of PALETTE.
        ink: Colour of digit and words.
        symbols: Drawings of the symbol, at least two.
        digit: Number in the bottom corner.
        short: Wording of one line.
        long: Wording of two lines, separated by "|".
        un: UN numbers.
        second: Colour of the second field, a key of PALETTE or "black"; "" for none.
        second_shape: "lower", "stripes", "half stripes", "upper bordered" or "lower bordered".
        symbol_ink: Colour of the symbol if it differs from `ink`.
        letters: Compatibility letters of class 1.
        bars: Number of red bars of class 7.
        boxed: Whether a box for an index is below the words (class 7).
        inhalation: Whether some prints have the symbol in a black diamond (49 CFR 172.429 and 555).
        underlined: Whether the digit is underlined (class 9).
    """

    field: str
    ink: str
    symbols: tuple[Symbol, ...]
    digit: str
    short: str
    long: str
    un: tuple[str, ...]
    second: str = ""
    second_shape: str = ""
    symbol_ink: str = ""
    letters: tuple[str, ...] = ()
    bars: int = 0
    boxed: bool = False
    inhalation: bool = False
    underlined: bool = False

    @property
    def hazard_number(self) -> str:
        """Hazard identification number on orange panels (ADR 5.3.2.3); '' for class 1."""
        if self.letters:
            return ""
        return HAZARD_NUMBERS[self.digit, self.field]


FLAMES: tuple[Symbol, ...] = symbols.FLAMES
SKULLS: tuple[Symbol, ...] = (symbols.skull_wide, symbols.skull_crossed, symbols.skull_line)
CYLINDERS = tuple(
    partial(symbols.cylinder, angle=angle, valve_right=right)
    for angle, right in ((20, True), (14, False), (30, True), (24, False))
)
BOMBS = tuple(partial(symbols.bomb, hand=hand) for hand in (0, 1))
RINGS = tuple(partial(symbols.flame_over_circle, flame=flame) for flame in range(3))
TREFOILS = (symbols.trefoil, partial(symbols.trefoil, radius=27.0))
CORROSIONS = tuple(partial(symbols.corrosion, hand=hand) for hand in (0, 1))
HAZARDS = (symbols.biohazard, partial(symbols.biohazard, size=6.4))
FISSILES = tuple(partial(symbols.fissile, font=font) for font in (0, 1))


def _divisions(*texts: str) -> tuple[Symbol, ...]:
    return tuple(
        partial(symbols.division, text=text, font=font)
        for text in texts
        for font in ((0, 1, 2) if len(texts) == 1 else (0,))
    )


def _plain(_: str) -> str:
    return ""


_EXPLOSIVES = ("1", "EXPLOSIVE", "EXPLOSIVE|ARTICLES")
_GAS = ("2", "FLAMMABLE", "FLAMMABLE|GAS", ("1075", "1978", "1049", "1971"))
_COLD = ("2", "NON-FLAMMABLE GAS", "NON-FLAMMABLE|GAS", ("1013", "1066", "1006", "3159"))
_LIQUID = ("3", "FLAMMABLE", "FLAMMABLE|LIQUID", ("1203", "1202", "1993", "1263", "1170"))
_WET = ("4", "DANGEROUS", "DANGEROUS|WHEN WET", ("1402", "1428", "1394", "1423"))
_PEROXIDE = ("5.2", "ORGANIC PEROXIDE", "ORGANIC|PEROXIDE", ("3105", "3109", "3107"), "yellow")
_RADIOACTIVE = ("7", "RADIOACTIVE", "RADIOACTIVE|MATERIAL", ("2912", "2915", "3332"))
_UPPER = ("yellow", "upper bordered")

FAMILIES = {
    "C1.1": Family(
        "orange",
        BLACK,
        BOMBS,
        *_EXPLOSIVES,
        ("0081", "0027", "0082"),
        letters=("1.1 D", "1.1 C", "1.1 G", "1.1 A"),
    ),
    "C1.2": Family(
        "orange",
        BLACK,
        _divisions("1.4"),
        *_EXPLOSIVES,
        ("0012", "0323", "0336"),
        letters=("S", "G", "S", "C", "D"),
    ),
    "C1.3": Family(
        "orange",
        BLACK,
        _divisions("1.5"),
        "1",
        "EXPLOSIVE",
        "BLASTING|AGENT",
        ("0331", "0332"),
        letters=("D",),
    ),
    "C1.4": Family("orange", BLACK, _divisions("1.6"), *_EXPLOSIVES, ("0486",), letters=("N",)),
    "C2.1": Family("red", BLACK, FLAMES, *_GAS),
    "C2.2": Family("red", WHITE, FLAMES, *_GAS),
    "C2.3": Family("green", BLACK, CYLINDERS, *_COLD),
    "C2.4": Family("green", WHITE, CYLINDERS, *_COLD),
    "C2.5": Family(
        "white",
        BLACK,
        SKULLS,
        "2",
        "TOXIC GAS",
        "INHALATION|HAZARD",
        ("1005", "1017", "1079"),
        inhalation=True,
    ),
    "C3.1": Family("red", BLACK, FLAMES, *_LIQUID),
    "C3.2": Family("red", WHITE, FLAMES, *_LIQUID),
    "C4.1": Family(
        "white",
        BLACK,
        FLAMES,
        "4",
        "FLAMMABLE SOLID",
        "FLAMMABLE|SOLID",
        ("1325", "1350", "2213"),
        "red",
        "stripes",
    ),
    "C4.2": Family(
        "white",
        BLACK,
        FLAMES,
        "4",
        "COMBUSTIBLE",
        "SPONTANEOUSLY|COMBUSTIBLE",
        ("1361", "1362", "1381"),
        "red",
        "lower",
    ),
    "C4.3": Family("blue under black", BLACK, FLAMES, *_WET),
    "C4.4": Family("blue", WHITE, FLAMES, *_WET),
    "C5.1": Family(
        "yellow",
        BLACK,
        RINGS,
        "5.1",
        "OXIDIZER",
        "OXIDIZING|AGENT",
        ("1942", "2067", "2014", "1495"),
    ),
    "C5.2": Family("red", BLACK, FLAMES, *_PEROXIDE, "lower"),
    "C5.3": Family("red", BLACK, FLAMES, *_PEROXIDE, "lower", symbol_ink=WHITE),
    "C6.1": Family(
        "white",
        BLACK,
        SKULLS,
        "6",
        "POISON",
        "TOXIC|SUBSTANCE",
        ("2810", "1689", "1593"),
        inhalation=True,
    ),
    "C6.2": Family(
        "white", BLACK, HAZARDS, "6", "INFECTIOUS", "INFECTIOUS|SUBSTANCE", ("2814", "2900", "3373")
    ),
    "C7.1": Family("white", BLACK, TREFOILS, *_RADIOACTIVE, bars=1),
    "C7.2": Family("white", BLACK, TREFOILS, *_RADIOACTIVE, *_UPPER, bars=2, boxed=True),
    "C7.3": Family(
        "white",
        BLACK,
        FISSILES,
        "7",
        "CRITICALITY",
        "CRITICALITY|SAFETY INDEX",
        ("3327", "3328", "2977"),
        boxed=True,
    ),
    "C7.4": Family("white", BLACK, TREFOILS, *_RADIOACTIVE, *_UPPER, bars=3, boxed=True),
    "C8.1": Family(
        "white",
        WHITE,
        CORROSIONS,
        "8",
        "CORROSIVE",
        "CORROSIVE|SUBSTANCE",
        ("1789", "1830", "1824", "1760"),
        "black",
        "lower bordered",
        symbol_ink=BLACK,
    ),
    "C9.1": Family(
        "white",
        BLACK,
        (_plain,),
        "9",
        "MISCELLANEOUS",
        "MISCELLANEOUS|GOODS",
        ("3082", "3077", "3480"),
        "black",
        "half stripes",
        underlined=True,
    ),
}
"""Families in the order of fastgen.classes.MARKER_CLASSES."""

HAZARD_NUMBERS = {
    **{("2", "red"): "23", ("2", "green"): "20", ("2", "white"): "268", ("3", "red"): "33"},
    **{("4", "white"): "40", ("4", "blue"): "423", ("4", "blue under black"): "423"},
    **{("5.1", "yellow"): "50", ("5.2", "red"): "539", ("6", "white"): "60"},
    **{("7", "white"): "70", ("8", "white"): "80", ("9", "white"): "90"},
}
"""Hazard identification number by digit and field."""

SMALL_PRINT = (
    *(
        "IN CASE OF LEAKAGE KEEP CLEAR AND",
        "INFORM THE CARRIER",
        "OR THE HARBOUR OFFICE",
        "AT ONCE",
    ),
    *(
        "DO NOT REMOVE BEFORE THE UNIT IS CLEAN",
        "STOW AWAY FROM HEAT",
        "SEE DOCUMENTS",
        "FOR DETAILS",
    ),
)
"""Lines of small print. Every class has them, so their number does not tell a class."""
