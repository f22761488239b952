"""Mixtures of colours."""

from fastgen.scene import Color


def mixed(first: Color, second: Color, share: float) -> Color:
    """Return a mixture of linear colours, with `share` of the second one."""
    red, green, blue = (
        round(float(a + share * (b - a)), 4) for a, b in zip(first, second, strict=True)
    )
    return red, green, blue
