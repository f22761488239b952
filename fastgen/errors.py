"""Errors that a user can act on: they name the file, field or value and say what to do."""


class FastgenError(Exception):
    """Base of every error raised for bad input or a missing capability of the machine."""


class ConfigError(FastgenError):
    """A configuration value, key or preset that cannot be used."""


class AssetError(FastgenError):
    """A missing, broken or unsuitable file: an HDRI, a font, a marker."""


class ContextError(FastgenError):
    """This machine gives no OpenGL context, or CUDA no access to what it draws."""


class OutputError(FastgenError):
    """An output folder that cannot be written or holds something else."""
