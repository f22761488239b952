"""Overlap of boxes (x0, y0, x1, y1): IoU of all pairs, and the generalized IoU for training."""

import torch


def iou(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return the IoU [N, M] of boxes [N, 4] and [M, 4]; 0 if both are empty."""
    low = torch.maximum(a[:, None, :2], b[None, :, :2])
    high = torch.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    areas = area(a)[:, None] + area(b)[None] - shared
    return shared / areas.clamp(min=1e-9)


def area(boxes: torch.Tensor) -> torch.Tensor:
    """Return the area of boxes [..., 4]; 0 if a side is negative."""
    return (boxes[..., 2:] - boxes[..., :2]).clamp(min=0).prod(-1)


def generalized_iou(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return the generalized IoU of boxes [..., 4] in pairs, -1..1 (Rezatofighi et al. 2019)."""
    low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    union = area(a) + area(b) - shared
    hull = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    hull_area = hull.clamp(min=0).prod(-1).clamp(min=1e-9)
    return shared / union.clamp(min=1e-9) - (hull_area - union) / hull_area
