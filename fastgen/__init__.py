"""fastgen: exactly labelled synthetic images of shipping containers, rasterized fast."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastgen.config.config import Config, LabelConfig
    from fastgen.dataset.generate import generate
    from fastgen.dataset.job import Job
    from fastgen.errors import AssetError, ConfigError, ContextError, FastgenError, OutputError
    from fastgen.export import export_glb, to_trimesh
    from fastgen.frame import Frame
    from fastgen.generator import Generator
    from fastgen.preview import grid
    from fastgen.recording import export_rerun
    from fastgen.render.settings import RenderSettings
    from fastgen.sample import Object, Sample
    from fastgen.scene import (
        Ageing,
        Camera,
        ChromaNoise,
        Container,
        Damage,
        Decal,
        Defocus,
        Dirt,
        EnvironmentView,
        Ground,
        Lamp,
        Lens,
        Meter,
        Neighbour,
        Noise,
        Paint,
        Pose,
        Prop,
        Rain,
        Response,
        Rust,
        Scene,
        Scratches,
        Seal,
        Sensor,
        Sharpening,
        Spreader,
        Stamp,
        Surface,
        Wear,
        Weather,
    )

__all__ = [
    "Ageing",
    "AssetError",
    "Camera",
    "ChromaNoise",
    "Config",
    "ConfigError",
    "Container",
    "ContextError",
    "Damage",
    "Decal",
    "Defocus",
    "Dirt",
    "EnvironmentView",
    "FastgenError",
    "Frame",
    "Generator",
    "Ground",
    "Job",
    "LabelConfig",
    "Lamp",
    "Lens",
    "Meter",
    "Neighbour",
    "Noise",
    "Object",
    "OutputError",
    "Paint",
    "Pose",
    "Prop",
    "Rain",
    "RenderSettings",
    "Response",
    "Rust",
    "Sample",
    "Scene",
    "Scratches",
    "Seal",
    "Sensor",
    "Sharpening",
    "Spreader",
    "Stamp",
    "Surface",
    "Wear",
    "Weather",
    "export_glb",
    "export_rerun",
    "generate",
    "grid",
    "to_trimesh",
]
__version__ = "0.45.0"

_HOMES = {
    "Config": "config.config",
    "Frame": "frame",
    "Generator": "generator",
    "Job": "dataset.job",
    "LabelConfig": "config.config",
    "Object": "sample",
    "RenderSettings": "render.settings",
    "Sample": "sample",
    "export_glb": "export",
    "export_rerun": "recording",
    "generate": "dataset.generate",
    "grid": "preview",
    "to_trimesh": "export",
}
"""Modules of public names; the other names are errors and parts of a scene."""


def __getattr__(name: str) -> Any:
    """Import a public name at its first use (PEP 562).

    Importing NumPy, OpenCV and SciPy takes a second, in which the command must react to Ctrl-C.
    """
    if name not in __all__:
        raise AttributeError(f"module 'fastgen' has no attribute {name!r}")
    module = _HOMES.get(name, "errors" if name.endswith("Error") else "scene")
    value = globals()[name] = getattr(import_module(f"fastgen.{module}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
