"""Elements that can be removed from an image: from its scene, shaders, meshes or light."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from fastgen.geometry.container import NOMINAL_PROFILES
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.shape_library import SHAPES, ShapeLibrary, SpreaderShape
from fastgen.geometry.spreader import USUAL_GAP_MM
from fastgen.light.environment import EnvironmentLight, load_environment
from fastgen.light.hdri import bundled_hdris
from fastgen.light.indirect_light import FormFactors
from fastgen.light.sky_visibility import open_sky
from fastgen.render.gl import open_context
from fastgen.render.program import shader_text
from fastgen.render.renderer import Renderer
from fastgen.render.session import GpuSession
from fastgen.render.settings import QUALITY
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe
from fastgen.scene import Scene, Spreader
from fastgen.scene.container_kinds import WallProfiles

STUBS = Path(__file__).with_name("ablation_shaders")
"""Shader files without an effect; each replaces the file of the same name in shaders/."""

MeshEdit = Callable[[Mesh], Mesh]


@dataclass(frozen=True)
class Element:
    """One modelled element, and how to remove it.

    Attributes:
        group: Group that --only of ablation.py can select.
        name: Name in the table.
        scene: Function that returns the scene without the element.
        files: Text of each shader file that replaces the one of the same name.
        without: Material layers to leave out.
        container: Edit of the container's mesh.
        spreader: Edit of the spreader's mesh.
        open_sky: Remove the occlusion of the sky.
        indirect: False to remove indirect light from surfaces on the spreader.
    """

    group: str
    name: str
    scene: Callable[[Scene], Scene] | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    container: MeshEdit | None = None
    spreader: MeshEdit | None = None
    open_sky: bool = False
    indirect: bool = True

    def shapes(self) -> ShapeLibrary:
        """Return a library of the meshes without the element."""
        if self.container is None and self.spreader is None:
            return SHAPES
        return _EditedShapes(self.container, self.spreader)

    @contextmanager
    def light_removed(self) -> Iterator[None]:
        """Make renderers used in this context compute the light without the element.

        Sky visibility is that of the unedited meshes.
        """
        with ExitStack() as stack:
            if self.container or self.spreader or self.open_sky:
                for name in ("container_light", "spreader_light"):
                    probe = _probe(getattr(SkyVisibilityProbe, name), self.open_sky)
                    stack.enter_context(mock.patch.object(SkyVisibilityProbe, name, probe))
            if not self.indirect:
                stack.enter_context(mock.patch.object(FormFactors, "light", _sky_only))
            yield


def gpu_session(elements: Sequence[Element], quality: str) -> GpuSession:
    """Return a session whose renderer lacks the shader files and material layers of elements.

    Args:
        elements: The elements to remove.
        quality: Quality preset.
    """
    files = {name: text for element in elements for name, text in element.files.items()}
    make = partial(
        Renderer,
        light=_bundled_light,
        quality=QUALITY[quality],
        read=partial(_read, files),
        without=tuple(layer for element in elements for layer in element.without),
    )
    return GpuSession(open_context, make)


def _bundled_light(name: str) -> EnvironmentLight:
    return load_environment(bundled_hdris()[name])


def _read(files: Mapping[str, str], name: str) -> str:
    return files[name] if name in files else shader_text(name)


def _sky_only(_: FormFactors, sky: np.ndarray, *others: Any) -> np.ndarray:
    """Replace FormFactors.light: no light comes from other surfaces."""
    return np.asarray(sky)


class _EditedShapes(ShapeLibrary):
    """Shapes with edited meshes."""

    def __init__(self, container: MeshEdit | None, spreader: MeshEdit | None) -> None:
        super().__init__()
        self._container_edit = container
        self._spreader_edit = spreader

    def container(self, kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> Mesh:
        return _edited_mesh(SHAPES.container(kind, profiles), self._container_edit)

    def container_outline(self, kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> Mesh:
        return _edited_mesh(SHAPES.container_outline(kind, profiles), self._container_edit)

    def spreader(
        self, kind: str, flippers_down: tuple[bool, bool], gap_mm: float = USUAL_GAP_MM
    ) -> SpreaderShape:
        return _edited_shape(SHAPES.spreader(kind, flippers_down, gap_mm), self._spreader_edit)


_SOURCES: dict[Mesh, Mesh] = {}
"""The unedited mesh of each edited one."""


@lru_cache(maxsize=512)
def _edited_mesh(mesh: Mesh, edit: MeshEdit | None) -> Mesh:
    if edit is None:
        return mesh
    edited = edit(mesh)
    _SOURCES[edited] = mesh
    return edited


@lru_cache(maxsize=64)
def _edited_shape(shape: SpreaderShape, edit: MeshEdit | None) -> SpreaderShape:
    if edit is None:
        return shape
    return SpreaderShape(_edited_mesh(shape.mesh, edit), _edited_mesh(shape.outline, edit))


@lru_cache(maxsize=64)
def _all_open(mesh: Mesh) -> LitMesh:
    dark = np.zeros(mesh.normals.shape, np.float32)
    return LitMesh(mesh, open_sky(mesh.normals), dark, dark)


def _probe(measured: Callable[..., LitMesh], whole_sky: bool) -> Callable[..., LitMesh]:
    """Wrap a SkyVisibilityProbe method to use the unedited meshes, or to return unoccluded sky."""

    def found(self: SkyVisibilityProbe, mesh: Mesh, *others: Any) -> LitMesh:
        if whole_sky:
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


def filled_apertures(mesh: Mesh) -> Mesh:
    """Give the castings' apertures the paint of the castings."""
    charts = tuple(
        replace(chart, material="casting") if chart.name.endswith(".aperture") else chart
        for chart in mesh.charts
    )
    return replace(mesh, charts=charts)


def _without_decals(*kinds: str) -> Callable[[Scene], Scene]:
    return lambda scene: replace(
        scene, decals=tuple(decal for decal in scene.decals if decal.kind not in kinds)
    )


def _without_art(*words: str) -> Callable[[Scene], Scene]:
    return lambda scene: replace(
        scene,
        decals=tuple(decal for decal in scene.decals if not decal.art.startswith(words)),
    )


def _fresh_print(scene: Scene) -> Scene:
    whole = (0.0, 0.0, 0.0, 0.0)
    fresh = [replace(decal, wear=0.0, fade=0.0, torn=whole) for decal in scene.decals]
    return replace(scene, decals=tuple(fresh))


def _without_wear(part: str, name: str) -> Callable[[Scene], Scene]:
    """Return an edit that sets the field `name` of a part of the surface to 0."""

    def edit(scene: Scene) -> Scene:
        less = replace(getattr(scene.surface, part), **{name: 0.0})
        return replace(scene, surface=replace(scene.surface, **{part: less}))

    return edit


def _stub(name: str) -> dict[str, str]:
    return {name: (STUBS / name).read_text(encoding="utf-8")}


ELEMENTS = (
    Element("surface", "tone of the paint", without=("tone",)),
    Element("surface", "ageing toward corners", without=("ageing",)),
    Element("surface", "bleached paint", _without_wear("paint", "bleach")),
    Element("surface", "dirt along edges", without=("dirt",)),
    Element("surface", "streaks of dirt", _without_wear("dirt", "streaks")),
    Element("surface", "rust", without=("rust",)),
    Element("surface", "scratches", without=("scratches",)),
    Element("surface", "scrapes of forks and spreaders", _without_wear("scratches", "scrapes")),
    Element("surface", "worn reflection", without=("reflection",)),
    Element("decals", "markers", _without_decals("marker")),
    Element("decals", "texts", _without_decals("text")),
    Element("decals", "stickers, emblems, stripes", _without_decals("sticker", "emblem")),
    Element(
        "decals",
        "holders, rivets and orange panels of markers",
        _without_art("marker_holder", "marker_rivets", "un_panel"),
    ),
    Element("decals", "traces of removed markers", _without_art("overpaint", "placard_residue")),
    Element("decals", "wear of decals", _fresh_print),
    Element("decals", "repainted patches", _without_art("patch")),
    Element("shape", "damage", Scene.undamaged),
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
    Element("shape", "door gaskets", container=without_charts("door.gasket", "door.lip")),
    Element("shape", "castings' apertures", container=filled_apertures),
    Element("shape", "fork pockets", container=without_charts("fork.")),
    Element("shape", "seals", lambda scene: replace(scene, seals=())),
    Element("shape", "spreader", lambda scene: replace(scene, spreader=Spreader())),
    Element(
        "shape",
        "spreader: cables",
        spreader=without_charts("cables."),
    ),
    Element("shape", "spreader: headblock", spreader=without_charts("headblock.")),
    Element("shape", "spreader: flippers", spreader=without_charts(".flippers")),
    Element("light", "occlusion of the sky", open_sky=True),
    Element("light", "shadow of the sun", files=_stub("light_visibility.glsl")),
    Element("light", "bounces in occluded places", files=_stub("occluder_indirect.glsl")),
    Element("light", "light from surfaces on the spreader", indirect=False),
    Element(
        "light",
        "reflections lean away from what hides the sky",
        files=_stub("lobe_direction.glsl"),
    ),
    Element("light", "occlusion of reflections", files=_stub("lobe_visibility.glsl")),
    Element("light", "energy of multiple scattering", files=_stub("multiple_scattering.glsl")),
    Element("light", "reflections altogether", files=_stub("environment_light.glsl")),
)
