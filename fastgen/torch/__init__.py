"""Datasets that render images and targets while a PyTorch model trains, without files.

A dataset is described by three groups of settings:

    RenderSettings  how an image is rendered: size, quality, device
    SceneSettings   which scenes an epoch has, and which cameras see them
    ItemSettings    what an item holds: form of the target, dtype, transforms, pairs
"""

try:
    import torch  # noqa: F401
except ImportError as error:
    raise ImportError(
        "fastgen.torch needs PyTorch: pip install 'fastgen[torch]', or torch itself"
    ) from error

from fastgen.render.settings import RenderSettings
from fastgen.torch.balance import class_counts, class_weights
from fastgen.torch.datasets import ContainerDataset, ContainerStream
from fastgen.torch.loader import Loader, ShardSampler
from fastgen.torch.plan import SceneSettings
from fastgen.torch.targets import (
    ItemSettings,
    class_names,
    collate_door,
    collate_lists,
    collate_seal,
    collate_text,
    collate_yolo,
)

__all__ = [
    "ContainerDataset",
    "ContainerStream",
    "ItemSettings",
    "Loader",
    "RenderSettings",
    "SceneSettings",
    "ShardSampler",
    "class_counts",
    "class_names",
    "class_weights",
    "collate_door",
    "collate_lists",
    "collate_seal",
    "collate_text",
    "collate_yolo",
]
