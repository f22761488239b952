"""The artwork of recent scenes as a texture array."""

from collections import OrderedDict
from collections.abc import Collection, Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import art_layers, art_levels, mip_levels, premultiplied
from fastgen.files import disk_cache
from fastgen.render.gl import GLContext
from fastgen.render.textures import fill_layers, levelled_storage

_FIRST_ROOM = 96
"""Layers at first, 32 MiB. Three scenes with one container, which the renderer keeps for a moment,
use about 80."""


class ArtTextures:
    """Layers of artwork, filled when a scene needs them. Owned by MaterialTextures.

    All bundled artwork would take 70 MiB in each process. Layers that no scene uses any more stay
    until their place is needed.

    Attributes:
        texture: The texture array. It is replaced when it has to grow.
    """

    def __init__(
        self, gl: GLContext, own: Mapping[str, NDArray[np.uint8]], room: int = _FIRST_ROOM
    ) -> None:
        """Allocate the layers.

        Args:
            gl: Current context.
            own: Further artwork by name, uint8 [ART_SIZE, ART_SIZE, 4] with straight alpha.
            room: Number of layers at first.
        """
        self._gl = gl
        self._bundled = art_layers()
        self._own = {name: _own_levels(image) for name, image in own.items()}
        self._places: dict[str, int] = {}
        self._users: dict[str, int] = {}
        self._unused: OrderedDict[str, None] = OrderedDict()
        self._free = list(range(room))[::-1]
        self._room = room
        self.texture = self._allocated()

    def take(self, names: Collection[str]) -> Mapping[str, int]:
        """Return the layer of each artwork, which stays until `give_back`.

        Args:
            names: Names of artwork; other names are left out.
        """
        known = [name for name in sorted(names) if name in self._bundled or name in self._own]
        for name in known:
            self._users[name] = self._users.get(name, 0) + 1
            self._unused.pop(name, None)
        missing = [name for name in known if name not in self._places]
        if len(missing) > len(self._free) + len(self._unused):
            self._grow(len(self._users))
        for name in missing:
            if not self._free:
                self._free.append(self._places.pop(self._unused.popitem(last=False)[0]))
            self._places[name] = self._free.pop()
            self._fill(name)
        return {name: self._places[name] for name in known}

    def give_back(self, names: Collection[str]) -> None:
        """Say that a scene needs its layers no more; the names are those of its `take`."""
        for name in names:
            self._users[name] -= 1
            if not self._users[name]:
                del self._users[name]
                self._unused[name] = None

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()

    def _grow(self, needed: int) -> None:
        """Replace the texture by one with room for more layers, and fill those in use."""
        room = self._room
        while room < needed:
            room *= 2
        room = min(room, len(self._bundled) + len(self._own))
        self._free += range(self._room, room)
        self._room = room
        self.texture.release()
        self.texture = self._allocated()
        for name in self._places:
            self._fill(name)

    def _allocated(self) -> moderngl.TextureArray:
        sizes = [level.shape[1] for level in art_levels()]
        return levelled_storage(self._gl, (sizes[0], self._room), len(sizes), srgb=True)

    def _fill(self, name: str) -> None:
        fill_layers(self._gl, self.texture, self._places[name], self._levels(name))

    def _levels(self, name: str) -> Sequence[NDArray[np.uint8]]:
        if name in self._own:
            return self._own[name]
        layer = self._bundled[name]
        found = [level[layer : layer + 1].copy() for level in art_levels()]
        for level in art_levels():  # other processes read the same file
            disk_cache.unload(level)
        return found


def _own_levels(image: NDArray[np.uint8]) -> Sequence[NDArray[np.uint8]]:
    return [premultiplied(level[None]) for level in (image, *mip_levels(image))]
