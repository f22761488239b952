"""Datasets that render while a PyTorch model trains: images and targets, no files in between."""

try:
    import torch  # noqa: F401
except ImportError as error:
    raise ImportError(
        "fastgen.torch needs PyTorch: pip install 'fastgen[torch]', or torch itself"
    ) from error

from fastgen.torch.balance import class_counts, class_weights
from fastgen.torch.datasets import ContainerDataset, ContainerStream
from fastgen.torch.loader import Loader, ShardSampler
from fastgen.torch.targets import (
    class_names,
    collate_door,
    collate_lists,
    collate_text,
    collate_yolo,
)

__all__ = [
    "ContainerDataset",
    "ContainerStream",
    "Loader",
    "ShardSampler",
    "class_counts",
    "class_names",
    "class_weights",
    "collate_door",
    "collate_lists",
    "collate_text",
    "collate_yolo",
]
