"""Weights panel of a container door, with invented but plausible figures."""

import numpy as np

# Typical manufacturers' values for each container kind; they are not from a standard.
_TARE_KG = {"20": 2200, "40": 3740, "40HC": 3900, "45HC": 4820}
_GROSS_KG = {"20": 30480, "40": 30480, "40HC": 32500, "45HC": 34000}
_CUBE_M3 = {"20": 33.2, "40": 67.7, "40HC": 76.3, "45HC": 86.0}
_LB_PER_KG = 1 / 0.45359237
_CUBIC_FEET_PER_M3 = 35.3146667


def weight_lines(kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Sample the lines of a weights panel.

    Args:
        kind: Container kind: 20, 40, 40HC or 45HC.
        rng: Random generator.

    Returns:
        Gross weight, tare and net weight in kilograms and pounds, and capacity in cubic metres and
        cubic feet, one line each.
    """
    gross = _GROSS_KG[kind] + int(rng.integers(-2, 3)) * 10
    tare = _TARE_KG[kind] + int(rng.integers(-20, 21)) * 10
    rows = [("MAX GROSS", gross), ("TARE", tare), ("NET", gross - tare)]
    lines = [f"{name} {kg} KG {round(kg * _LB_PER_KG)} LB" for name, kg in rows]
    cube = _CUBE_M3[kind] + round(float(rng.uniform(-0.4, 0.4)), 1)
    lines.append(f"CU.CAP. {cube:.1f} CU.M {round(cube * _CUBIC_FEET_PER_M3)} CU.FT")
    return tuple(lines)


def entries(line: str) -> tuple[str, str, str]:
    """Return name, metric value and imperial value of a line from `weight_lines`."""
    words = line.split(" ")
    return " ".join(words[:-4]), " ".join(words[-4:-2]), " ".join(words[-2:])
