"""Checks of decals that change colours and have no label."""

from dataclasses import replace

import numpy as np


def added(pair):
    """Return the decals that the second scene of a pair has before all decals of the first."""
    bare, given = pair
    count = len(given.decals) - len(bare.decals)
    assert given.decals[count:] == bare.decals
    return given.decals[:count]


def assert_same_labels(plain, other):
    """Compare ids, damage targets and Objects of two samples."""
    np.testing.assert_array_equal(plain.ids, other.ids)
    np.testing.assert_array_equal(plain.damage, other.damage)
    assert plain.objects == other.objects


def changed_pixels(generator, pairs, cameras):
    """Return the number of pixels that differ between the two scenes of each pair.

    Labels must be the same.
    """
    changed = 0
    for bare, given in pairs:
        for camera in cameras:
            plain = generator.render(scene=bare, camera=camera)
            other = generator.render(scene=given, camera=camera)
            assert_same_labels(plain, other)
            changed += int((plain.image != other.image).any(axis=2).sum())
    return changed


def bare_of(scene, chosen):
    """Return a scene without some of its decals."""
    return replace(scene, decals=tuple(d for d in scene.decals if d not in chosen))
