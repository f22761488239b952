"""Geometry pass: meshes -> visibility buffer."""

from collections.abc import Mapping

import moderngl

from fastgen.geometry.damage_law import corners_mm, largest_mm, outward_mm
from fastgen.light.sky_visibility import lobe_masks
from fastgen.render.constants import LOBE_CELLS, REACH_MARGIN_MM
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.program import Programs, ShaderProgram
from fastgen.render.regions import bounding_region, within
from fastgen.render.variant import DAMAGE_VARIANTS, ShaderVariant
from fastgen.scene.damage_kinds import form_of


class GeometryPass:
    """Draws container, seals and spreader into the visibility buffer.

    Undamaged surfaces, those that damages touch, and the interior that each hole reveals have a
    program of their own.

    Reads: the lobe masks of sky_visibility.py, which it owns, and for holes the zone table. Writes:
    the visibility buffer.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs, kinds: tuple[str, ...]) -> None:
        self._ctx = ctx
        stages = ("geometry.vert", "geometry.frag")
        self._programs: dict[str, ShaderProgram] = {
            damage: programs.get(stages, ShaderVariant(damage=damage, kinds=kinds))
            for damage in DAMAGE_VARIANTS
        }
        masks = lobe_masks(LOBE_CELLS)
        self._lobes = ctx.texture(masks.shape[1::-1], 4, masks.tobytes(), dtype="u4")
        self._lobes.filter = (moderngl.NEAREST, moderngl.NEAREST)

    @property
    def programs(self) -> Mapping[str, moderngl.Program]:
        """The linked program of each damage variant; GpuMesh lays out its vertices for them."""
        linked = ((name, program.linked) for name, program in self._programs.items())
        return {name: item for name, item in linked if isinstance(item, moderngl.Program)}

    def run(self, inputs: DrawInputs) -> None:
        """Draw the meshes, and add the buffer's textures to `inputs.textures`."""
        samples, damages = inputs.samples, inputs.damages
        regions, damage = inputs.regions, inputs.variant.damage
        drawn = regions.drawn
        # other parts may keep an earlier image's rest positions: only rays read them everywhere
        rest = drawn if inputs.variant.traced else regions.near_damage
        samples.begin(damage, drawn, rest, regions.holes, inputs.variant.over)
        if not regions.surfaces:
            inputs.textures.update(samples.textures)
            return
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._ctx.front_face = "cw"  # clip y points down, see View.clip_matrix
        textures = {**inputs.textures, "lobe_masks": self._lobes}
        self._programs["undamaged"].bind(textures)
        if inputs.spreader is not None:
            inputs.spreader.draw("undamaged", inputs.spreader.seen_from(inputs.eye_mm))
        if inputs.seals is not None:
            # before the container: damaged surfaces behind a seal must not leave a rest position
            inputs.seals.draw("undamaged", inputs.seals.seen_from(inputs.eye_mm))
        # a dent may tilt a face into view that the rest mesh turns away
        tilted = [d.face for d in damages if form_of(d).along_edge or outward_mm(d) > 0]
        bent = {face for place in tilted for face in place.split(".")}
        container = inputs.container
        seen = container.seen_from(inputs.eye_mm, bent)
        if damages:
            boxes = [corners_mm(item) for item in damages]
            seen, touched = container.clusters.parted(seen, boxes, REACH_MARGIN_MM)
            container.draw("undamaged", seen)
            samples.begin_damaged()
            self._programs["damaged"].bind(textures)
            container.draw("damaged", touched)
        else:
            container.draw("undamaged", seen)
        moved_mm = sum(map(largest_mm, damages)) if regions.holes else 0.0
        self._programs["holed"].bind(textures)
        for region in regions.holes:
            samples.limit_inside(region)
            container.draw("holed", container.clusters.seen_in(inputs.view, region, moved_mm))
        samples.end()
        inputs.textures.update(samples.textures)

    def run_cables(self, inputs: DrawInputs) -> None:
        """Draw the parts of the spreader in regions that show nothing else, as `run` does."""
        samples, spreader = inputs.samples, inputs.spreader
        regions = within(inputs.regions.surfaces, (0, 0, *inputs.targets.size))
        assert spreader is not None, "only scenes with a spreader have regions of cables"
        samples.begin("undamaged", regions, over=inputs.variant.over)
        whole = bounding_region(regions)
        samples.limit(whole)
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._ctx.front_face = "cw"
        self._programs["undamaged"].bind({**inputs.textures, "lobe_masks": self._lobes})
        spreader.draw("undamaged", spreader.clusters.seen_in(inputs.view, whole, 0.0))
        samples.end()
        inputs.textures.update(samples.textures)

    def release(self) -> None:
        """Free the lobe masks."""
        self._lobes.release()
