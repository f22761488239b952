"""Tables of HTML for notebooks, and the one that shows a Scene."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fastgen.scene.data import Scene
    from fastgen.scene.decal import Decal


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; None is an empty cell."""

    def line(tag: str, cells: Sequence[object]) -> str:
        texts = ("" if cell is None else escape(str(cell)) for cell in cells)
        return "<tr>" + "".join(f"<{tag}>{text}</{tag}>" for text in texts) + "</tr>"

    body = "".join(line("td", row) for row in rows)
    return f"<table><thead>{line('th', head)}</thead><tbody>{body}</tbody></table>"


def scene_table(scene: "Scene") -> str:
    """Return a table of the parts of a scene."""
    container = scene.container
    rows: list[tuple[str, str]] = [
        ("scene", f"seed {scene.seed}, index {scene.index}"),
        ("container", container.kind if container.present else "none"),
        ("paint", scene.surface.paint.name),
        ("environment", f"{scene.environment.name}, turned by {scene.environment.yaw_deg:.0f}°"),
        ("cameras", ", ".join(camera.name for camera in scene.cameras)),
        ("damages", ", ".join(f"{each.kind} on {each.face}" for each in scene.damages)),
        ("markers", ", ".join(f"{each.class_name} on {each.face}" for each in _markers(scene))),
        ("texts", "; ".join(each.text for each in scene.decals if each.class_name == "text")),
        ("neighbours", str(len(scene.neighbours))),
        ("ground", scene.ground.kind if scene.ground else ""),
    ]
    return html_table(("part", "value"), [row for row in rows if row[1] not in ("", "0")])


def _markers(scene: "Scene") -> Iterable["Decal"]:
    return (each for each in scene.decals if each.class_name not in ("", "text"))
