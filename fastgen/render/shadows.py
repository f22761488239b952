"""Shadow maps of the containers of a scene."""

import moderngl

from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.light.directional_lights import DirectionalLight
from fastgen.light.environment import to_map_frame
from fastgen.render.depth_map import occluder_program
from fastgen.render.shadow_map import ShadowMap

_MAPS = 8
"""Largest number of maps. Further containers share the last map, so each image draws it again for
every one. A map takes 3 MB in draft quality and 21 MB in balanced quality."""


class Shadows:
    """Shadow map of each container of the last scene. Owned by the renderer, which releases it.

    Args:
        ctx: Current OpenGL context.
        detail: See ShadowMap.
    """

    def __init__(self, ctx: moderngl.Context, detail: float) -> None:
        self._ctx = ctx
        self._detail = detail
        self._program = occluder_program(ctx)
        self._maps: list[ShadowMap] = []

    def of(self, number: int) -> ShadowMap:
        """Return the map of a container by its number in the scene."""
        number = min(number, _MAPS - 1)
        while len(self._maps) <= number:
            self._maps.append(ShadowMap(self._ctx, self._program, self._detail))
        return self._maps[number]

    def cast(
        self, member: Member, whole: PreparedScene, lights: tuple[DirectionalLight, ...]
    ) -> ShadowMap | None:
        """Draw what directional lights leave in the shade on a container.

        Args:
            member: The container.
            whole: Its scene, whose other containers cast shadows on it.
            lights: The lights.

        Returns:
            The map; None without lights.
        """
        if not lights:
            return None
        own, shadow = member.prepared, self.of(member.number)
        scene, outline = own.scene, own.container_outline
        toward = to_map_frame([each.direction for each in lights], -scene.environment.yaw_deg)
        container = own.container if scene.damages else outline  # only fine triangles bend
        spreader = None if own.spreader is None else own.spreader.solid
        others = whole.others[member.number]
        shadow.cast(container, spreader, toward, scene.damages, outline, others)
        return shadow

    def release(self) -> None:
        """Free all GL objects."""
        for shadow in self._maps:
            shadow.release()
        self._program.release()
