"""Sampling of the weights panel on the door (ISO 6346, section 5)."""

from itertools import product

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.lettering import TextPart, ink_width_mm
from fastgen.decals.weights import entries, weight_lines
from fastgen.sampling.lettering_style import BAR_GAP_MM, Style, in_any_font, part_text, placed
from fastgen.sampling.sheet import Sheet, between, tenth
from fastgen.sampling.streams import Streams
from fastgen.scene import Decal
from fastgen.validation import Range

_TRIES = 16

_LINE_CAPS = 1.35
"""Distance between the two values of an entry, in cap heights."""

_ENTRY_CAPS = Range(3.2, 4.0)
"""Distance between entries, in cap heights."""


def sample_weights(
    config: MarkingsConfig, kind: str, door: Sheet, style: Style, streams: Streams
) -> list[Decal]:
    """Sample the weights: names left of the right leaf's outer locking bar, values right of it.

    If there is no room, each name is above its values, in one column beside a bar.
    """
    rng = streams("weights")
    lines = weight_lines(kind, rng)
    wear = round(float(rng.uniform(*config.text_wear)), 3)
    cap, least = between(rng, config.weights_cap_mm), config.weights_cap_mm.lo
    step = between(rng, _ENTRY_CAPS)
    assert door.clearance is not None
    inner, outer = door.clearance.bars[-2:]
    shapes = (
        (cap, outer, True),
        (least, outer, True),
        (least, outer, False),
        (least, inner, False),
    )
    for inked, (height, bar, beside) in product(in_any_font(config, style, rng), shapes):
        gap = (between(rng, BAR_GAP_MM), between(rng, BAR_GAP_MM))
        columns = sum(gap) + bar[1] - bar[0] if beside else None
        parts, across = _parts(lines, inked, height, step, columns)
        start = bar[0] - gap[0] - across if beside else bar[1] + gap[1]
        width = max(part.x_mm + ink_width_mm(part.text, inked.font, height) for part in parts)
        if not door.holds_lettering(start, start + width):
            continue
        text, lettering = part_text(lines, parts, height, inked, False)
        width, tall = lettering.size_mm
        for _ in range(_TRIES):
            y = tall / 2 + rng.uniform(0.05, 0.95) * (door.size[1] - tall)
            center = (tenth(start + width / 2), tenth(y))
            if door.claim(center, lettering.size_mm, lettering.parts):
                return [placed(text, door, center, wear=wear)]
    return []


def _parts(
    lines: tuple[str, ...], style: Style, cap_mm: float, step_caps: float, gap_mm: float | None
) -> tuple[tuple[TextPart, ...], float]:
    """Return the parts of all entries, and the width of their names.

    Args:
        lines: The entries.
        style: Font of all letters.
        cap_mm: Height of the capitals.
        step_caps: Distance between entries in cap heights.
        gap_mm: Gap between names and values; None for values below their names.
    """
    rows = [entries(line) for line in lines]
    across = max(ink_width_mm(name, style.font, cap_mm) for name, _, _ in rows)
    line = _LINE_CAPS * cap_mm
    x = 0.0 if gap_mm is None else tenth(across + gap_mm)
    above = line if gap_mm is None else 0.0
    step = step_caps * cap_mm + above
    found = []
    for i, (name, metric, imperial) in enumerate(rows):
        low = (len(rows) - 1 - i) * step
        found.append(TextPart("", name, 0.0, tenth(low + line + above)))
        found.append(TextPart("", metric, x, tenth(low + line)))
        found.append(TextPart("", imperial, x, tenth(low)))
    return tuple(found), across
