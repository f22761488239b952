"""Sampling of one container: corrugation, paint and ageing, damages, decals and seals."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fastgen.config.config import Config
from fastgen.config.fields import linear_color
from fastgen.config.surface import SurfaceConfig
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.shape_library import SHAPES
from fastgen.sampling.chalk import sample_chalk
from fastgen.sampling.damage import sample_damages
from fastgen.sampling.damage_spots import damage_spots
from fastgen.sampling.markings import sample_decals
from fastgen.sampling.repairs import sample_repairs
from fastgen.sampling.runs import sample_runs
from fastgen.sampling.seals import sample_seals
from fastgen.sampling.sheet import Sheet
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene import (
    Ageing,
    Container,
    Damage,
    Decal,
    Dirt,
    Paint,
    Rust,
    Scratches,
    Seal,
    Surface,
    Wear,
)
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.faces import SHEET_FACES
from fastgen.validation import Range


class Contents(NamedTuple):
    """A container with everything on it, in its own frame."""

    container: Container
    surface: Surface
    decals: tuple[Decal, ...]
    damages: tuple[Damage, ...]
    seals: tuple[Seal, ...]


def sample_contents(
    config: Config,
    kind: str,
    streams: Streams,
    image_share: Callable[[Damage], float] = lambda _: 1.0,
    color: str | None = None,
) -> Contents:
    """Sample a container of a kind with everything on it.

    Args:
        config: Distribution of scenes.
        kind: Container kind, a key of `KINDS`.
        streams: Function from the name of a property to its independent random generator.
        image_share: Function from a damage of this container to the largest part of an image that
            it covers, see DamageVisibility.image_share.
        color: Name of its paint; None to draw one.
    """
    scale = float(one_of(streams("corrugation"), config.container.depth_scale))
    container = Container(kind, config.container.profiles.deepened(scale))
    surface = _surface(config.surface, streams, color)
    damages = sample_damages(config.damage, KINDS[kind].size_mm, streams, image_share)
    mesh = SHAPES.container(kind, container.profiles)
    sheets = _empty_sheets(container, mesh)
    decals = sample_decals(config.markings, kind, sheets, surface.paint.albedo, streams)
    runs = sample_runs(config.markings.runs, mesh, decals, damages, surface, streams)
    drawn = [*decals, *runs]
    # after all others, so that nothing makes room for them
    spots = damage_spots(mesh, damages)
    repairs = sample_repairs(config.markings.repairs, sheets, spots, surface, drawn, streams)
    chalk = sample_chalk(config.markings.chalk, sheets, spots, [*repairs, *drawn], streams)
    seals = sample_seals(config.seals, damages, streams)
    return Contents(container, surface, (*repairs, *drawn, *chalk), damages, seals)


def of_neighbours(config: Config) -> Config:
    """Return the distribution of scenes with the shares of damage and markers of neighbours."""
    placement, damage, markings = config.placement, config.damage, config.markings
    marked = markings.marked_containers * placement.marked
    return replace(
        config,
        damage=replace(damage, probability=damage.probability * placement.damaged),
        markings=replace(markings, marked_containers=marked),
    )


def sheet_sizes(mesh: Mesh) -> dict[str, tuple[float, float]]:
    """Return the size of the unfolded sheet of each face that carries decals.

    Args:
        mesh: Container mesh.

    Returns:
        Width and height in mm by face.
    """
    rects = {face: mesh.charts[mesh.chart_index(face)].rect_mm for face in SHEET_FACES}
    return {face: (rect[2], rect[3]) for face, rect in rects.items()}


def _empty_sheets(container: Container, mesh: Mesh) -> dict[str, Sheet]:
    """Return the sheets of a container without decals."""
    clearance = SHAPES.door_clearance(container.kind, container.profiles)
    return {
        face: Sheet(face, size, clearance=clearance)
        if face == "door"
        else Sheet(face, size, mesh.flats.get(face, ()))
        for face, size in sheet_sizes(mesh).items()
    }


def _surface(c: SurfaceConfig, streams: Streams, color: str | None) -> Surface:
    weights = np.array(c.weights)
    # equal weights would give other results than no weights
    shares = weights / weights.sum() if c.color_weights else None
    name = str(streams("paint.color").choice(list(c.colors), p=shares)) if color is None else color
    rust = streams("rust")
    rust_color = one_of(streams("rust.color"), c.rust_colors)
    # The square makes heavily rusted containers rare.
    low, high = c.rust_coverage
    coverage = low + (high - low) * float(rust.random()) ** 2
    return Surface(
        paint=Paint(
            name,
            linear_color(c.colors[name]),
            c.roughness.draw(streams("paint.roughness")),
            c.tone_variation.draw(streams("paint.tone")),
            c.bleach.draw(streams("paint.bleach")),
        ),
        ageing=Ageing(
            c.ageing_strength.draw(streams("ageing.strength")),
            c.ageing_reach_mm.draw(streams("ageing.reach")),
        ),
        dirt=Dirt(
            c.dirt_strength.draw(streams("dirt.strength")),
            c.dirt_reach_mm.draw(streams("dirt.reach")),
            linear_color(c.dirt_color),
            c.dirt_streaks.draw(streams("dirt.streaks")),
        ),
        rust=Rust(
            coverage,
            c.rust_scale_mm.draw(streams("rust.scale")),
            linear_color(rust_color),
            c.rust_roughness.draw(streams("rust.roughness")),
        ),
        scratches=Scratches(
            c.scratch_coverage.draw(streams("scratches")), c.scrapes.draw(streams("scrapes"))
        ),
        wear=Wear(
            c.wear_strength.draw(streams("wear")),
            c.wear_scale_mm.draw(streams("wear.scale")),
        ),
        noise_offset_mm=(
            Range(0, 50000).draw(streams("noise.x")),
            Range(0, 50000).draw(streams("noise.y")),
        ),
    )
