"""Uniform blocks: GLSL declaration and std140 packing from one list of members.

Layout: OpenGL 4.5 core specification, section 7.6.2.2 (standard uniform block layout).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

_TYPES: dict[str, tuple[int, int, str]] = {
    "float": (1, 4, "f4"),
    "int": (1, 4, "i4"),
    "vec2": (2, 8, "f4"),
    "vec3": (3, 16, "f4"),
    "vec4": (4, 16, "f4"),
    "mat4": (16, 16, "f4"),
}
"""Number of components, base alignment in bytes and dtype of each GLSL type."""


@dataclass(frozen=True)
class Block:
    """Uniform block in std140 layout.

    Attributes:
        name: Name of the block in GLSL.
        binding: Its binding point.
        members: GLSL type and name of each member, and the length of an array.
    """

    name: str
    binding: int
    members: tuple[tuple[str, str] | tuple[str, str, int], ...]
    _offsets: dict[str, tuple[int, str, int]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Compute the offset of every member."""
        offset = 0
        for member in self.members:
            kind, name = member[0], member[1]
            length = member[2] if len(member) == 3 else 0
            components, align, _ = _TYPES[kind]
            if length and kind not in ("vec4", "mat4"):
                raise AssertionError(f"{name}: only vec4 and mat4 can be arrays")
            offset = -(-offset // align) * align
            self._offsets[name] = (offset, kind, length)
            offset += components * 4 * max(length, 1)
        self._offsets[""] = (-(-offset // 16) * 16, "", 0)

    @property
    def size(self) -> int:
        """Size of the block in bytes."""
        return self._offsets[""][0]

    def glsl(self) -> str:
        """Return the declaration of the block."""
        lines = [
            f"    {m[0]} {m[1]}[{m[2]}];" if len(m) == 3 else f"    {m[0]} {m[1]};"
            for m in self.members
        ]
        head = f"layout(std140, binding = {self.binding}) uniform {self.name} {{"
        return "\n".join([head, *lines, "};"]) + "\n"

    def pack(self, values: Mapping[str, ArrayLike]) -> bytes:
        """Return the contents of the block's buffer.

        Args:
            values: Value of every member by name. Matrices are row-major, [..., 4, 4]. Arrays may
                be shorter than declared; zeros fill the rest.

        Returns:
            `size` bytes in std140 layout.
        """
        data = np.zeros(self.size, np.uint8)
        wrong = {m[1] for m in self.members} ^ set(values)
        if wrong:
            raise AssertionError(f"{self.name}: {sorted(wrong)} are missing or unknown")
        for name, value in values.items():
            offset, kind, length = self._offsets[name]
            components, _, dtype = _TYPES[kind]
            array = np.asarray(value, dtype)
            if kind == "mat4":
                array = np.swapaxes(array.reshape(-1, 4, 4), 1, 2)
            rows = np.ascontiguousarray(array).reshape(-1, components)
            if len(rows) > max(length, 1):
                raise AssertionError(f"{name}: {len(rows)} values do not fit {max(length, 1)}")
            data[offset : offset + rows.nbytes] = rows.view(np.uint8).ravel()
        return data.tobytes()
