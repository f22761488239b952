"""Elements that can be removed from an image: by the scene, by shader text, or by mesh parts."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any
from unittest import mock

import numpy as np

from fastgen.geometry.mesh import Mesh
from fastgen.geometry.shape_library import ShapeLibrary, SpreaderShape
from fastgen.light import sky_visibility
from fastgen.light.indirect_light import FormFactors
from fastgen.render import programs
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe
from fastgen.scene import Scene, Spreader
from fastgen.scene.faces import FACE_AXES

MeshEdit = Callable[[Mesh], Mesh]


@dataclass(frozen=True)
class Element:
    """One modelled element, and how to remove it.

    Sky visibility is still computed with the unedited meshes.

    Attributes:
        group: Group that --only of ablation.py can select.
        name: Name in the table.
        scene: Function that returns the scene without the element.
        text: Pairs of old and new shader text. Every old text must occur in some shader.
        container: Edit of the container's mesh.
        spreader: Edit of the spreader's mesh.
        open_sky: Remove the occlusion of the sky.
        thrown: False to remove indirect light from surfaces on the spreader.
    """

    group: str
    name: str
    scene: Callable[[Scene], Scene] | None = None
    text: tuple[tuple[str, str], ...] = ()
    container: MeshEdit | None = None
    spreader: MeshEdit | None = None
    open_sky: bool = False
    thrown: bool = True


class Absence:
    """Removal of an element from all renders made while the context `gone` is active."""

    def __init__(self, element: Element) -> None:
        self.element = element
        self._found: set[str] = set()

    def scene(self, scene: Scene) -> Scene:
        """Return the scene without the element."""
        return self.element.scene(scene) if self.element.scene else scene

    @contextmanager
    def gone(self) -> Iterator[None]:
        """Make renderers that are created and used in this context omit the element."""
        with ExitStack() as stack:
            for owner, name, value in self._replacements():
                stack.enter_context(mock.patch.object(owner, name, value))
            yield

    def check(self) -> None:
        """Check that all shader text to be replaced was found.

        Raises:
            SystemExit: Some text was not in any shader that was compiled.
        """
        for old, _ in self.element.text:
            if old not in self._found:
                raise SystemExit(
                    f"{self.element.name}: no shader contains {old!r}; update ablation_elements.py"
                )

    def _replacements(self) -> Iterator[tuple[Any, str, Any]]:
        element = self.element
        if element.text:
            yield programs, "expand", self._edited(programs.expand)
        if element.container:
            for name in ("container", "container_outline"):  # as drawn, and for sun shadows
                yield ShapeLibrary, name, _edited_container(name, element.container)
        if element.spreader:
            yield ShapeLibrary, "spreader", _edited_spreader(element.spreader)
        for name in ("container_light", "spreader_light"):
            yield (
                SkyVisibilityProbe,
                name,
                _probe(getattr(SkyVisibilityProbe, name), element.open_sky),
            )
        if not element.thrown:
            yield FormFactors, "light", lambda _, sky, *others: np.asarray(sky)

    def _edited(self, expand: Callable[..., str]) -> Callable[..., str]:
        def edited(*args: Any, **kwargs: Any) -> str:
            text = expand(*args, **kwargs)
            for old, new in self.element.text:
                if old in text:
                    self._found.add(old)
                    text = text.replace(old, new)
            return text

        return edited


_SOURCES: dict[Mesh, Mesh] = {}
"""The unedited mesh of each edited one."""


@lru_cache(maxsize=512)
def _edited_mesh(mesh: Mesh, edit: MeshEdit) -> Mesh:
    edited = edit(mesh)
    _SOURCES[edited] = mesh
    return edited


def _edited_container(name: str, edit: MeshEdit) -> Callable[..., Mesh]:
    whole = getattr(ShapeLibrary, name)
    return lambda *args, **named: _edited_mesh(whole(*args, **named), edit)


def _edited_spreader(edit: MeshEdit) -> Callable[..., SpreaderShape]:
    whole = ShapeLibrary.spreader
    return lambda *args, **named: _edited_shape(whole(*args, **named), edit)


@lru_cache(maxsize=64)
def _edited_shape(shape: SpreaderShape, edit: MeshEdit) -> SpreaderShape:
    return SpreaderShape(_edited_mesh(shape.mesh, edit), _edited_mesh(shape.outline, edit))


@lru_cache(maxsize=64)
def _all_open(mesh: Mesh) -> LitMesh:
    dark = np.zeros(mesh.normals.shape, np.float32)
    return LitMesh(mesh, sky_visibility.open_sky(mesh.normals), dark, dark)


def _probe(measured: Callable[..., LitMesh], open_sky: bool) -> Callable[..., LitMesh]:
    """Wrap a SkyVisibilityProbe method to use the unedited meshes, or to return unoccluded sky."""

    def found(self: SkyVisibilityProbe, mesh: Mesh, *others: Any) -> LitMesh:
        if open_sky:
            return _all_open(mesh)
        return measured(self, *(_unedited(item) for item in (mesh, *others)))

    return found


def _unedited(item: Any) -> Any:
    return _SOURCES.get(item, item) if isinstance(item, Mesh) else item


def without_charts(*words: str) -> MeshEdit:
    """Return an edit that removes the triangles of charts whose name contains one of `words`."""

    def edit(mesh: Mesh) -> Mesh:
        dropped = np.array([any(word in chart.name for word in words) for chart in mesh.charts])
        keep = ~dropped[mesh.chart[mesh.triangles[:, 0]]]
        groups, parts, start = {}, [], 0
        for name, part in mesh.groups.items():
            parts.append(mesh.triangles[part][keep[part]])
            groups[name] = slice(start, start + len(parts[-1]))
            start += len(parts[-1])
        return replace(mesh, triangles=np.concatenate(parts), groups=groups)

    return edit


def filled_pockets(mesh: Mesh) -> Mesh:
    """Close the castings' apertures flush with their faces."""
    positions = mesh.positions_mm.copy()
    for number, chart in enumerate(mesh.charts):
        if chart.name.endswith(".pocket"):
            out = np.array(FACE_AXES[chart.face].out, np.float32)
            mine = mesh.chart == number
            depth = positions[mine] @ out
            positions[mine] += (depth.max() - depth)[:, None] * out
    charts = tuple(
        replace(chart, material="casting") if chart.name.endswith(".pocket") else chart
        for chart in mesh.charts
    )
    return replace(mesh, positions_mm=positions, charts=charts)


def _without_decals(*kinds: str) -> Callable[[Scene], Scene]:
    return lambda scene: replace(
        scene, decals=tuple(decal for decal in scene.decals if decal.kind not in kinds)
    )


def _fresh_print(scene: Scene) -> Scene:
    return replace(scene, decals=tuple(replace(decal, wear=0.0) for decal in scene.decals))


def _layer(name: str) -> tuple[tuple[str, str], ...]:
    return ((f"#define SHOWN_{name} 1", f"#define SHOWN_{name} 0"),)


ELEMENTS = (
    Element("surface", "tone of the paint", text=_layer("TONE")),
    Element("surface", "ageing toward corners", text=_layer("AGEING")),
    Element("surface", "dirt along edges", text=_layer("DIRT")),
    Element("surface", "rust", text=_layer("RUST")),
    Element("surface", "scratches", text=_layer("SCRATCHES")),
    Element("surface", "worn reflection", text=_layer("REFLECTION")),
    Element("decals", "markers", _without_decals("marker")),
    Element("decals", "texts", _without_decals("text")),
    Element("decals", "stickers, emblems, stripes", _without_decals("sticker", "emblem")),
    Element("decals", "wear of decals", _fresh_print),
    Element("shape", "damage", lambda scene: replace(scene, damages=())),
    Element(
        "shape",
        "door gear: bars, cams, handles, hinges",
        container=without_charts(
            *(
                f"door.{part}."
                for part in ("bar", "cams", "keepers", "brackets", "handle", "hinges")
            )
        ),
    ),
    Element("shape", "door gaskets", container=without_charts("door.gasket")),
    Element("shape", "castings' apertures", container=filled_pockets),
    Element(
        "shape", "underside: members, fork pockets", container=without_charts("member.", "fork.")
    ),
    Element("shape", "spreader", lambda scene: replace(scene, spreader=Spreader())),
    Element(
        "shape",
        "spreader: cables",
        spreader=without_charts("cables."),
        text=(("return min(cover, 1.0);", "return 0.0;"),),
    ),
    Element("shape", "spreader: headblock", spreader=without_charts("headblock.")),
    Element("shape", "spreader: flippers", spreader=without_charts(".flippers")),
    Element("shape", "spreader: twist locks", spreader=without_charts(".locks.")),
    Element("light", "occlusion of the sky", open_sky=True),
    Element(
        "light",
        "shadow of the sun",
        text=(
            (
                "light_seen[0] = filtered_light_visibility(from_eye, normal, depth * pixel_angle);",
                "light_seen[0] = 1.0;",
            ),
            ("light_seen[i] = light_visibility(from_eye, i);", "light_seen[i] = 1.0;"),
        ),
    ),
    Element(
        "light",
        "bounces in occluded places",
        text=(
            (
                "return min(fit * (0.75 + max(0.75 - 1.5 * sky.rim, 0.0)), 1.0 - share);",
                "return vec3(0.0);",
            ),
        ),
    ),
    Element("light", "light from surfaces on the spreader", thrown=False),
    Element(
        "light",
        "the sun's light from walls in recesses",
        text=(
            ("sky.occluder_light = sky.bounces * occluder_light(from_eye, normal, sky, 0);", ""),
            ("sky.occluder_light += sky.bounces * occluder_light(from_eye, normal, sky, i);", ""),
        ),
    ),
    Element(
        "light",
        "reflections lean away from what hides the sky",
        text=(("fma(vec3(lean), aside, mirror), width", "mirror, width"),),
    ),
    Element(
        "light",
        "occlusion of reflections",
        text=(
            (
                "float open = lobe_visibility(sky, mirror, m.roughness);",
                "float open = 1.0;",
            ),
        ),
    ),
    Element(
        "light",
        "energy of multiple scattering",
        text=(("float gain = 1.0 / (dfg.x + dfg.y) - 1.0;", "float gain = 0.0;"),),
    ),
    Element(
        "light",
        "reflections altogether",
        text=(
            (
                "return r.diffuse * around + specular * mirrored;",
                "return m.albedo * (1.0 - m.metallic) * around;",
            ),
        ),
    ),
)
