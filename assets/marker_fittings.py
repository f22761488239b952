"""Drawings of orange panels, placard holders and rivets.

Sizes and colours of the panels: ADR 5.3.2.2 and IMDG Code 5.3.2.1.3.
"""

from drawing import BLACK, rect

ORANGE = "#ee7412"


def _svg(width: float, height: float, body: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'preserveAspectRatio="none">\n{body}\n</svg>\n'
    )


def _panel(width: float, height: float, divided: bool) -> str:
    """Orange plate with a black border of 15 mm (10 mm on the small one), in millimetres."""
    border = 15.0 if divided else 10.0
    inset = border / 2 + 2
    edge = f'stroke="{BLACK}" stroke-width="{border:g}"'
    body = rect(0, 0, width, height, ORANGE)
    body += rect(inset, inset, width - 2 * inset, height - 2 * inset, "none", edge)
    if divided:
        body += rect(0, height / 2 - 7, width, 14, BLACK)
    return _svg(width, height, body)


def _diamond(margin: float) -> str:
    near, far = margin, 1000 - margin
    return f"M500 {near:g} L{far:g} 500 L500 {far:g} L{near:g} 500 Z"


def _rivet(x: float, y: float, radius: float) -> str:
    """Rivet head that is lit from above."""
    rim = f'<circle cx="{x:g}" cy="{y:g}" r="{radius:g}" fill="#4b4d4f"/>'
    dome = f'<circle cx="{x:g}" cy="{y - 0.12 * radius:g}" r="{0.8 * radius:g}" fill="#8f9294"/>'
    shine = f'<circle cx="{x:g}" cy="{y - 0.35 * radius:g}" r="{0.3 * radius:g}" fill="#c9cbcc"/>'
    return rim + dome + shine


def _holder() -> str:
    """Frame of sheet metal on its point with rivets; a marker covers its middle."""
    frame = f'<path fill="#8d9092" d="{_diamond(0)}"/>'
    lip = f'<path fill="none" stroke="#55585a" stroke-width="7" d="{_diamond(8)}"/>'
    flange = f'<path fill="none" stroke="#b4b7b9" stroke-width="8" d="{_diamond(26)}"/>'
    places = ((500, 24), (976, 500), (500, 976), (24, 500))
    rivets = "".join(_rivet(x, y, 9) for x, y in places)
    return _svg(1000, 1000, frame + lip + flange + rivets)


def _rivets() -> str:
    """Four rivets through the corners of a marker made of sheet metal, and four along its edges."""
    corners = ((500, 66), (934, 500), (500, 934), (66, 500))
    edges = ((276, 276), (724, 276), (724, 724), (276, 724))
    return _svg(1000, 1000, "".join(_rivet(x, y, 15) for x, y in corners + edges))


FITTINGS = {
    "un_panel": _panel(400, 300, True),
    "un_panel_small": _panel(300, 120, False),
    "marker_holder": _holder(),
    "marker_rivets": _rivets(),
}
"""SVG of each drawing by name."""
