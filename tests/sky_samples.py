"""Environments and directions from formulas that do not use fastgen."""

import cv2
import numpy as np


def texel_grid(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions [H, 2H, 3] and solid angles [H, 2H] of equirectangular texels."""
    v, u = np.mgrid[0:height, 0 : 2 * height] + 0.5
    polar, turn = np.pi * v / height, 2 * np.pi * (0.5 - u / (2 * height))
    direction = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1
    )
    return direction, np.sin(polar) * (np.pi / height) ** 2


def quarter_sphere(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions [N, 3] with z > 0 and y > 0, and their solid angles [N].

    The other half of the upper hemisphere mirrors them.
    """
    middle = (np.arange(steps) + 0.5) / steps * np.pi
    theta, phi = (each.ravel() for each in np.meshgrid(middle / 2, middle))
    direction = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    return direction, np.sin(theta) * (np.pi / 2 / steps) * (np.pi / steps)


def even_directions(count: int) -> np.ndarray:
    """Return directions [count, 3] of a Fibonacci sphere; each covers the same solid angle."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)


def patchwork(seed: int, height: int = 128) -> np.ndarray:
    """Return a random environment of soft colours and a few strong lamps, float32 [H, 2H, 3]."""
    rng = np.random.default_rng(seed)
    soft = cv2.resize(rng.random((8, 16, 3), dtype=np.float32), (2 * height, height))
    direction, _ = texel_grid(height)
    for lamp in even_directions(5) + rng.normal(0, 0.3, (5, 3)):
        lamp /= np.linalg.norm(lamp)
        soft += 20 * rng.random(3) * np.exp((direction @ lamp - 1)[..., None] / 0.005)
    return soft.astype(np.float32)


def one_light(direction: np.ndarray, radiance: float, height: int = 128) -> np.ndarray:
    """Return a black environment with one lit texel, the nearest to `direction`."""
    grid, _ = texel_grid(height)
    image = np.zeros((height, 2 * height, 3), np.float32)
    image[np.unravel_index((grid @ direction).argmax(), grid.shape[:2])] = radiance
    return image


def lamps_at_night(
    toward: np.ndarray, lights: np.ndarray, height: int = 512, radius_deg: float = 0.9
) -> np.ndarray:
    """Return a sky of radiance 0.02 with a uniform disc around each direction, float32 [H, 2H, 3].

    Args:
        toward: Directions of the discs [K, 3].
        lights: Irradiance / pi that each disc gives [K, 3].
    """
    direction, solid_angle = texel_grid(height)
    sky = np.full((height, 2 * height, 3), 0.02)
    for way, light in zip(toward, lights, strict=True):
        disc = np.arccos(np.clip(direction @ way, -1, 1)) < np.deg2rad(radius_deg)
        sky[disc] += np.pi * np.asarray(light) / solid_angle[disc].sum()
    return sky.astype(np.float32)
