"""Enumerations of the shapes and variants that a configuration can produce, for preloading."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fastgen.config.config import Config, ContainerConfig
from fastgen.config.fields import linear_color
from fastgen.config.sensor import LensConfig
from fastgen.sampling.scene import rounded_gap_mm
from fastgen.scene import Container, Spreader
from fastgen.scene.damage_kinds import kind_named
from fastgen.scene.optics import Lens


def possible_shapes(config: Config) -> Iterator[tuple[Container, Spreader]]:
    """Yield every combination of container and spreader that a scene can have.

    Args:
        config: Distribution of scenes.

    Yields:
        Container and spreader. Spreaders of other colours have the same shape and are skipped.
    """
    c = config.spreader
    lowered = [v for v, p in ((True, c.flippers_down), (False, 1 - c.flippers_down)) if p > 0]
    low, high = c.gap_mm
    gaps = {rounded_gap_mm(c, gap) for gap in (*np.arange(low, high, 5).tolist(), high)}
    spreaders = [
        Spreader(True, linear_color(c.colors[0]), (front, back), gap)
        for front, back in itertools.product(lowered, repeat=2)
        for gap in sorted(gaps)
    ]
    bare = replace(spreaders[0], present=False)
    sometimes_bare = c.probability < 1 or config.placement.has_neighbours
    held = spreaders * (c.probability > 0) + [bare] * sometimes_bare
    for single in single_container_configs(config.container):
        (kind,), (scale,) = single.kinds, single.depth_scale
        container = Container(kind, config.container.profiles.deepened(scale))
        yield from ((container, spreader) for spreader in held)


def single_container_configs(config: ContainerConfig) -> Iterator[ContainerConfig]:
    """Yield one configuration per possible container, which always produces that container.

    Args:
        config: Distribution of containers.

    Yields:
        Configurations with a single kind and a single corrugation depth.
    """
    for kind, weight in config.kinds.items():
        for scale in config.depth_scale * (weight > 0):
            yield replace(config, kinds={kind: 1.0}, depth_scale=(scale,))


def damage_variant_configs(config: Config) -> Iterator[Config]:
    """Yield configurations for undamaged, bent and perforated containers, as far as possible.

    All their scenes have a container.

    The renderer has a shader variant for each of the three.

    Args:
        config: Distribution of scenes.

    Yields:
        `config` without damage, then with the damage kinds that make no hole, then with holes
        only. The last two have a damage probability of 1.
    """
    config = replace(config, container=replace(config.container, absent=0.0))
    damage = config.damage
    yield replace(config, damage=replace(damage, probability=0.0))
    holes = tuple(k for k in damage.kinds if any(form.outline for form in kind_named(k).forms))
    for kinds in (tuple(k for k in damage.kinds if k not in holes), holes):
        if damage.probability > 0 and kinds:
            yield replace(config, damage=replace(damage, probability=1.0, kinds=kinds))


def extreme_lenses(config: LensConfig) -> Iterator[Lens]:
    """Yield the lenses at the ends of all coefficient ranges.

    Args:
        config: Distribution of lenses.

    Yields:
        Every combination of the lowest and highest value of each coefficient.
    """
    ends = [sorted({*getattr(config, name)}) for name in config.names]
    return (Lens(config.model, values) for values in itertools.product(*ends))
