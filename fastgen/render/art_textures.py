"""The artwork of recent scenes as a texture array."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import art_layers, art_levels, mip_levels, premultiplied
from fastgen.files import disk_cache
from fastgen.render.gl import GLContext
from fastgen.render.textures import fill_layers, levelled_storage

_INITIAL_LAYERS = 96
"""Initial number of layers, 32 MiB. The current scene and the two scenes kept before it use about
80 if each has one container."""


class ArtTextures:
    """Layers of artwork, filled when a scene needs them. Owned by MaterialTextures.

    All bundled artwork would take 70 MiB in each process. Layers that no scene uses any more stay
    until their place is needed.

    Attributes:
        texture: The texture array. `take` replaces it when it has to grow.
    """

    def __init__(
        self,
        gl: GLContext,
        own: Mapping[str, NDArray[np.uint8]],
        capacity: int = _INITIAL_LAYERS,
    ) -> None:
        """Allocate the layers.

        Args:
            gl: Current context.
            own: Artwork of the configuration by name, uint8 [ART_SIZE, ART_SIZE, 4] with straight
                alpha.
            capacity: Initial number of layers.
        """
        self._gl = gl
        self._bundled = art_layers()
        self._own = {name: _own_levels(image) for name, image in own.items()}
        self._layers: dict[str, int] = {}  # those taken last come last
        self._use_counts: Counter[str] = Counter()
        self._free = list(range(capacity))[::-1]
        self.texture = self._allocated(capacity)
        _unmap()

    def take(self, names: Collection[str]) -> Mapping[str, int]:
        """Reserve a layer for each artwork until `give_back`, and return the layers by name.

        It may replace `texture`.

        Args:
            names: Names of artwork; other names are left out.
        """
        known = [name for name in sorted(names) if name in self._bundled or name in self._own]
        missing = [name for name in known if name not in self._layers]
        unused = [n for n in self._layers if n not in self._use_counts and n not in known]
        if len(missing) > len(self._free) + len(unused):
            self._grow(len(self._use_counts.keys() | set(known)))
        for name in missing:
            if not self._free:
                self._free.append(self._layers.pop(unused.pop(0)))
            self._fill(name, self._free[-1])
            self._layers[name] = self._free.pop()
        if missing:
            _unmap()
        self._use_counts.update(known)
        taken = {name: self._layers.pop(name) for name in known}
        self._layers.update(taken)
        return taken

    def give_back(self, names: Collection[str]) -> None:
        """Release the layers that one `take` returned.

        Args:
            names: Keys of the mapping that `take` returned.
        """
        self._use_counts -= Counter(list(names))  # which drops those that no scene uses

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()

    def _grow(self, needed: int) -> None:
        """Replace the texture by one with more layers, and fill those in use."""
        before = capacity = len(self._layers) + len(self._free)
        while capacity < needed:
            capacity *= 2
        capacity = min(capacity, len(self._bundled) + len(self._own))
        larger = self._allocated(capacity)
        self.texture.release()
        self.texture = larger
        self._free += range(before, capacity)
        for name, layer in self._layers.items():
            self._fill(name, layer)

    def _allocated(self, capacity: int) -> moderngl.TextureArray:
        sizes = [level.shape[1] for level in art_levels()]
        return levelled_storage(self._gl, (sizes[0], capacity), len(sizes), srgb=True)

    def _fill(self, name: str, layer: int) -> None:
        if name in self._own:
            levels = self._own[name]
        else:
            stored = self._bundled[name]
            levels = [level[stored : stored + 1] for level in art_levels()]
        fill_layers(self._gl, self.texture, layer, levels)


def _own_levels(image: NDArray[np.uint8]) -> Sequence[NDArray[np.uint8]]:
    return [premultiplied(level[None]) for level in (image, *mip_levels(image))]


def _unmap() -> None:
    """Take the pages of the stored artwork, all in one file, out of this process's memory."""
    disk_cache.unload(art_levels()[0])
