"""Shader programs: expanded source text, and the textures that a program reads."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import moderngl

from fastgen.classes import BUNDLED_DAMAGE_CLASSES, DRAWN_DAMAGE_CLASSES
from fastgen.errors import ConfigError
from fastgen.render.blocks import BLOCKS
from fastgen.render.constants import constants_text
from fastgen.render.variant import ShaderVariant
from fastgen.resources import shader_path
from fastgen.scene.damage_kinds import forms_of

_INCLUDE = re.compile(r'#include "([^"]+)"\n')
_VERSION = re.compile(r"#version .*\n")
_ERROR = re.compile(r"\d+:(\d+)\(\d+\): error: [^\n]*")
_SAMPLER = re.compile(r"^uniform [iu]?sampler\w+ (\w+);", re.M)

Read = Callable[[str], str]
"""Returns the text of a shader file by its name."""

Textures = Mapping[str, moderngl.Texture | moderngl.TextureArray]
"""Textures by the name of the sampler that reads them."""


@cache  # the programs of one renderer include some files a hundred times
def shader_text(name: str) -> str:
    """Return the text of a shader file that ships with fastgen, or of one with an absolute path.

    Raises:
        AssetError: The file does not exist.
    """
    return shader_path(name).read_text(encoding="utf-8")


def expand(text: str, variant: ShaderVariant, read: Read = shader_text) -> str:
    """Return the complete text of a shader.

    `#include "NAME.glsl"` is replaced by that file where it first occurs. `#include
    "NAME.constants"` and `#include "NAME.block"` say that a file needs a group of constants
    (constants.py) or a uniform block (blocks.py); each is declared behind the #version line.
    `#include "damage.forms"` stands for the files of all forms of damage that the variant draws.
    Nothing is included twice, so an include inside an #if must not be the first of a file that code
    outside needs too.

    Args:
        text: Shader text with a #version line.
        variant: What the constants are for.
        read: Returns the text of an included file.
    """
    needed: dict[str, None] = {}  # in order, each once

    def included(match: re.Match[str]) -> str:
        name = match[1]
        if name in needed:
            return ""
        needed[name] = None
        if name.endswith((".constants", ".block")):
            return ""
        if name == "damage.forms":
            files = (form.shader for form in forms_of(variant.kinds))
            return _INCLUDE.sub(included, "".join(f'#include "{file}"\n' for file in files))
        return _INCLUDE.sub(included, read(name))

    body = _INCLUDE.sub(included, text)
    version = _VERSION.search(body)
    assert version, "a shader needs a #version line"
    # lets the vertex stage send an instance to the inner view
    extension = (
        "#extension GL_ARB_shader_viewport_layer_array : enable\n"
        if variant.damage == "holed"
        else ""
    )
    constants = [
        constants_text(name.removesuffix(".constants"), variant)
        for name in needed
        if name.endswith(".constants")
    ]
    # block members are arrays whose lengths need no constant, but shaders use both
    blocks = [
        BLOCKS[name.removesuffix(".block")].glsl() for name in needed if name.endswith(".block")
    ]
    return "".join([version[0], extension, *constants, *blocks, body.replace(version[0], "", 1)])


def _blame_packages(log: str, texts: Sequence[str], variant: ShaderVariant) -> None:
    """Raise ConfigError for a program that does not compile and holds GLSL of packages."""
    kinds = [kind for kind in variant.kinds if kind not in BUNDLED_DAMAGE_CLASSES]
    if not kinds:
        return
    found = _ERROR.search(log)
    words, line = (found[0], int(found[1])) if found else (log.strip(), 0)
    stage = texts[-1] if "fragment_shader" in log else texts[0]
    sources = stage.splitlines()
    where = f" in {sources[line - 1].strip()!r}" if 0 < line <= len(sources) else ""
    raise ConfigError(
        f"damage.kinds: shaders with the GLSL of {', '.join(kinds)} do not compile "
        f"({words}{where}); mend the package of that kind"
    ) from None


class ShaderProgram:
    """A linked program that knows which textures it reads, and binds exactly those.

    Attributes:
        linked: The moderngl program or compute shader.
        reads: Names of the samplers that the program reads; each one's place is its texture unit.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        stages: Sequence[str],
        variant: ShaderVariant,
        read: Read = shader_text,
    ) -> None:
        """Compile and link shader files.

        Args:
            ctx: Current context.
            stages: A vertex and a fragment shader file, or one compute shader file.
            variant: What to compile them for.
            read: Returns the text of a shader file.
        """
        texts = [expand(read(stage), variant, read) for stage in stages]
        self.linked: moderngl.Program | moderngl.ComputeShader
        try:
            if len(texts) == 1:
                self.linked = ctx.compute_shader(texts[0])
            else:
                self.linked = ctx.program(vertex_shader=texts[0], fragment_shader=texts[1])
        except moderngl.Error as error:
            _blame_packages(str(error), texts, variant)
            raise
        declared = dict.fromkeys(name for text in texts for name in _SAMPLER.findall(text))
        self.reads = tuple(name for name in declared if name in self.linked)
        for unit, name in enumerate(self.reads):
            self.linked[name] = unit
        self._ctx = ctx
        self._empty: moderngl.VertexArray | None = None

    def __setitem__(self, uniform: str, value: object) -> None:
        """Set a uniform; one that the compiler removed is ignored."""
        if uniform in self.linked:
            self.linked[uniform] = value

    def bind(self, textures: Textures) -> None:
        """Bind the textures that the program reads.

        Raises:
            KeyError: A texture is missing.
        """
        for unit, name in enumerate(self.reads):
            textures[name].use(unit)

    def draw_vertices(self, count: int) -> None:
        """Draw triangles of `count` vertices that the vertex shader makes up itself."""
        assert isinstance(self.linked, moderngl.Program)
        if self._empty is None:
            self._empty = self._ctx.vertex_array(self.linked, [])
        self._empty.render(moderngl.TRIANGLES, vertices=count)

    def dispatch(self, across: int, down: int = 1) -> None:
        """Run a compute shader on a grid of work groups."""
        assert isinstance(self.linked, moderngl.ComputeShader)
        self.linked.run(across, down)

    def dispatch_indirect(self, buffer: moderngl.Buffer, offset: int) -> None:
        """Run a compute shader with the three work-group counts in a buffer.

        Args:
            buffer: Holds the counts along x, y and z, three uint32.
            offset: Position of the counts in the buffer, in bytes.
        """
        assert isinstance(self.linked, moderngl.ComputeShader)
        self.linked.run_indirect(buffer, offset)

    def release(self) -> None:
        """Free the GL objects."""
        if self._empty is not None:
            self._empty.release()
        self.linked.release()


class Programs:
    """The shader programs of a renderer, each compiled when it is first needed."""

    def __init__(self, ctx: moderngl.Context, read: Read = shader_text) -> None:
        self._ctx = ctx
        self._read = read
        self._linked: dict[tuple[tuple[str, ...], ShaderVariant], ShaderProgram] = {}

    def get(self, stages: Sequence[str], variant: ShaderVariant | None = None) -> ShaderProgram:
        """Return the program of some shader files for a variant."""
        variant = variant or ShaderVariant()
        if variant.damage == "undamaged":
            # no kind is drawn; with one text for all, drivers that cache on disk compile it once
            variant = replace(variant, kinds=DRAWN_DAMAGE_CLASSES)
        key = (tuple(stages), variant)
        if key not in self._linked:
            self._linked[key] = ShaderProgram(self._ctx, *key, self._read)
        return self._linked[key]

    def release(self) -> None:
        """Free all programs."""
        while self._linked:
            self._linked.popitem()[1].release()
