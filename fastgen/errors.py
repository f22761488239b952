"""Errors that a user can act on: they name the file, field or value and say what to do."""


class FastgenError(Exception):
    """Base of all errors for bad input or a missing capability of the machine."""


class ConfigError(FastgenError, ValueError):
    """Unusable configuration value, key, preset or argument.

    It is a ValueError so that pydantic reports it with the location of the value.
    """


class AssetError(FastgenError):
    """Missing, broken or unsuitable file: an HDRI, a font, a marker."""


class ContextError(FastgenError):
    """OpenGL context that this machine cannot create, or CUDA without access to its images."""


class OutputError(FastgenError):
    """Output folder that cannot be written or that holds something else."""
