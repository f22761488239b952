"""Ranges of what a real camera and its weather do to an image; everything is off by default."""

from dataclasses import dataclass, field

from fastgen.errors import ConfigError
from fastgen.records import Range, bounds, nearest
from fastgen.sensor.parts import LENS_MODELS

_ZERO = Range(0.0, 0.0)
_COEFFICIENT = bounds(-10.0, 10.0)


@dataclass(frozen=True)
class LensConfig:
    """A lens's distortion by OpenCV's coefficients, which differ a little between lenses of a kind.

    model: brown_conrady takes k1, k2, k3, p1 and p2, fisheye (Kannala-Brandt) k1 to k4. See
    sensor.parts.Lens.
    """

    model: str = "brown_conrady"
    k1: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k2: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k3: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k4: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    p1: Range = field(default=_ZERO, metadata=bounds(-0.1, 0.1))
    p2: Range = field(default=_ZERO, metadata=bounds(-0.1, 0.1))

    def check(self, path: str) -> None:
        """Raise ConfigError, naming what stands at `path`, for what the model has not."""
        if self.model not in LENS_MODELS:
            hint = nearest(self.model, LENS_MODELS)
            raise ConfigError(f"{path}.model: {self.model!r} is unknown{hint}")
        foreign = ("p1", "p2") if self.model == "fisheye" else ("k4",)
        for name in foreign:
            if getattr(self, name) != _ZERO:
                raise ConfigError(f"{path}.{name}: {self.model} has no {name}; leave it out")

    @property
    def names(self) -> tuple[str, ...]:
        """The model's coefficients in OpenCV's order."""
        fisheye = self.model == "fisheye"
        return ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
