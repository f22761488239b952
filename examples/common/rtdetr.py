"""RT-DETR (Zhao et al. 2023) from transformers, configured and newly initialized."""

from typing import Any

import torch
from transformers import RTDetrConfig, RTDetrForObjectDetection, RTDetrResNetConfig

from common.run import Learner

_CANDIDATES = 100


class RtDetr(Learner):
    """RT-DETR as a Learner. The sides of an image must be multiples of 32.

    Args:
        classes: Number of classes, without a background.
        small: Use a reduced backbone and decoder for tests instead of ResNet-50.
    """

    def __init__(self, classes: int, small: bool = False) -> None:
        super().__init__()
        backbone: dict[str, Any] = {"out_features": ["stage2", "stage3", "stage4"]}
        settings: dict[str, Any] = {"num_labels": classes}
        if small:
            backbone |= {"embedding_size": 16, "hidden_sizes": [16, 32, 48, 64]}
            backbone |= {"depths": [1, 1, 1, 1], "layer_type": "basic"}
            settings |= {"encoder_in_channels": [32, 48, 64], "encoder_hidden_dim": 64}
            settings |= {"decoder_in_channels": [64, 64, 64], "decoder_layers": 2}
            settings |= {"d_model": 64, "num_queries": 50}
        config = RTDetrConfig(backbone_config=RTDetrResNetConfig(**backbone), **settings)
        self.net = RTDetrForObjectDetection(config)

    def loss(self, images: list[torch.Tensor], targets: list[dict[str, Any]]) -> torch.Tensor:
        """Return the matched set loss.

        Args:
            images: uint8 [3, H, W] each.
            targets: Labels in the loader's detection form.
        """
        pixels = self._pixels(images)
        height, width = pixels.shape[2:]
        size = pixels.new_tensor([width, height, width, height])
        labels = []
        for target in targets:
            low, high = target["boxes"].to(pixels.device).split(2, dim=1)
            boxes = torch.cat([(low + high) / 2, high - low], dim=1) / size
            classes = target["labels"].to(pixels.device) - 1
            labels.append({"class_labels": classes, "boxes": boxes})
        loss: torch.Tensor = self.net(pixel_values=pixels, labels=labels).loss
        return loss

    @torch.no_grad()
    def predict(self, images: list[torch.Tensor]) -> list[dict[str, torch.Tensor]]:
        """Detect objects in images uint8 [3, H, W].

        Returns:
            For each image, best first and on the CPU: boxes float32 [N, 4] in pixels, labels int64
            [N] from 1, and scores float32 [N].
        """
        pixels = self._pixels(images)
        height, width = pixels.shape[2:]
        made = self.net(pixel_values=pixels)
        shares = made.logits.sigmoid()
        classes = shares.shape[2]
        scores, places = shares.flatten(1).topk(min(_CANDIDATES, shares[0].numel()))
        size = pixels.new_tensor([width, height, width, height])
        found = []
        for number in range(len(images)):
            chosen = made.pred_boxes[number, places[number] // classes]
            centre, sides = chosen.split(2, dim=1)
            boxes = torch.cat([centre - sides / 2, centre + sides / 2], dim=1).clamp(0, 1) * size
            one = {
                "boxes": boxes,
                "labels": places[number] % classes + 1,
                "scores": scores[number],
            }
            found.append({name: value.cpu() for name, value in one.items()})
        return found

    def _pixels(self, images: list[torch.Tensor]) -> torch.Tensor:
        return torch.stack(images).to(next(self.parameters()).device).float() / 255
