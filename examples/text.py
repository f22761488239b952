"""Identifiers: train a small convolutional network to read them from crops.

    python examples/text.py [--full]

It reads the owner code, serial number and check digit, 11 characters, but not the size-type code.
It learns the place of each letter from the parts of the labels. The layout of a crop is given to
it. Of all identifiers, it returns the most likely one with the right check digit. Reports by layout
how many identifiers are read without a mistake, and the character error rate. Needs
fastgen[examples]. --full trains a wider network on a GPU while workers render.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from common import charts
from common.data import Feed, Kept, rendered
from common.reader import CANVAS, Pixels, Reader, varied_batch, whole_canvas
from common.run import Learner, Plan, Run, Table, conclude, parameters, start, train
from numpy.typing import NDArray

from fastgen.torch import ContainerDataset, RenderSettings, SceneSettings

PLANS = {
    "cpu": Plan(images=800, test_images=200, size=(640, 640), batch=32, passes=24, rate=3e-3),
    "full": Plan(
        images=8000, test_images=1000, size=(1280, 1280), batch=16, passes=20, rate=1e-3, workers=12
    ),
    "smoke": Plan(images=4, test_images=4, size=(640, 640), batch=4, passes=1, rate=1e-3),
}
"""Images of the end cameras; on a CPU, as many of the side cameras are added. On a CPU, a batch
counts crops."""

SIDES_SIZE = (1600, 480)
"""Image size of the side cameras on a CPU, so that letters are as large as in the end cameras."""

_ROLES = ("owner", "serial", "check")

Parts = Sequence[tuple[str, str, torch.Tensor]]
"""Role, text and quad float32 [4, 2] of each part, as in the text items of fastgen.torch."""


@dataclass(frozen=True, eq=False)
class Identifier:
    """Crop of an identifier with the places of its letters, a KnownText.

    Attributes:
        pixels: RGB picture [H, W, 3].
        code: Owner code, serial number and check digit.
        layout: Key of CANVAS.
        letters_px: Centres of the letters of `code`, float64 [11, 2], x right and y down.
        frame_px: Box of all letters x0, y0, x1, y1.
    """

    pixels: Pixels
    code: str
    layout: str
    letters_px: NDArray[np.float64]
    frame_px: tuple[float, float, float, float]


class IdentifierReader(Reader, Learner):
    """Reader that trains on crops of fastgen.torch and varies them at random.

    Args:
        width: Channels of the first layer.
        seed: Seed of the variation.
    """

    def __init__(self, width: int = 16, seed: int = 1) -> None:
        super().__init__(width)
        self._rng = np.random.default_rng(seed)

    def loss(self, images: list[torch.Tensor], targets: list[dict[str, Any]]) -> torch.Tensor:
        """Return the loss of a batch, the mean over its crops.

        Args:
            images: Crops uint8 [3, h, w].
            targets: Text and parts of each crop.
        """
        pairs = zip(images, targets, strict=True)
        texts = [identifier(crop, target["parts"]) for crop, target in pairs]
        groups = [[t for t in texts if t.layout == layout] for layout in CANVAS]
        losses = [
            self.text_loss(varied_batch(group, self._rng)) * (len(group) / len(texts))
            for group in groups
            if group
        ]
        return torch.stack(losses).sum()


def identifier(crop: torch.Tensor, parts: Parts) -> Identifier:
    """Return a crop uint8 [3, h, w] with the places of its letters."""
    quads = {role: quad.double().numpy() for role, _, quad in parts}
    texts = {role: text for role, text, _ in parts}
    layout = layout_of(parts)
    letters = [
        letter_places(quads[role], len(texts[role]), vertical=layout == "column") for role in _ROLES
    ]
    corners = np.concatenate(list(quads.values()))
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Identifier(
        crop.permute(1, 2, 0).numpy(),
        "".join(texts[role] for role in _ROLES),
        layout,
        np.concatenate(letters),
        (x0, y0, x1, y1),
    )


def layout_of(parts: Parts) -> str:
    """Return 'rows', 'block' or 'column', from the places of owner code and serial number."""
    quads = {role: quad.double().numpy() for role, _, quad in parts}
    owner = quads["owner"]
    right = (owner[1] + owner[2] - owner[0] - owner[3]) / 2
    down = (owner[2] + owner[3] - owner[0] - owner[1]) / 2
    if np.linalg.norm(down) > np.linalg.norm(right):
        return "column"
    # in a block the serial number begins below the owner code, in rows behind it
    ahead = (quads["serial"].mean(axis=0) - owner.mean(axis=0)) @ right / (right @ right)
    return "rows" if ahead > 0.75 else "block"


def letter_places(quad: NDArray[np.float64], count: int, vertical: bool) -> NDArray[np.float64]:
    """Return centres [count, 2] of letters at even steps along a part.

    Args:
        quad: Corners [4, 2], clockwise from the upper left corner of the letters.
        count: Number of letters.
        vertical: True if the letters are below one another.
    """
    upper_left, upper_right, lower_right, lower_left = quad
    if vertical:
        first, last = (upper_left + upper_right) / 2, (lower_left + lower_right) / 2
    else:
        first, last = (upper_left + lower_left) / 2, (upper_right + lower_right) / 2
    steps = (np.arange(count) + 0.5) / count
    places: NDArray[np.float64] = first + steps[:, None] * (last - first)
    return places


def edit_distance(a: str, b: str) -> int:
    """Return the Levenshtein distance (1966): fewest insertions, deletions and substitutions."""
    row = list(range(len(b) + 1))
    for i, left in enumerate(a, start=1):
        before, row = row, [i]
        for j, right in enumerate(b, start=1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (left != right)))
    return row[-1]


def measured(codes: Sequence[str], read: Sequence[str]) -> dict[str, float]:
    """Score codes that were read.

    Returns:
        Percentages: exact matches, and character errors.
    """
    pairs = list(zip(codes, read, strict=True))
    exact = sum(wanted == got for wanted, got in pairs)
    wrong = sum(edit_distance(got, wanted) for wanted, got in pairs)
    return {
        "exact": 100 * exact / len(pairs),
        "character errors": 100 * wrong / sum(map(len, codes)),
    }


def data_of(run: Run, split: str) -> list[ContainerDataset]:
    """Return datasets of end and side cameras, with a new container in each image.

    With --full, one dataset covers all cameras.
    """
    plan = run.plan
    training = split == "train"
    length = plan.images if training else plan.test_images

    def data(size: tuple[int, int], cameras: tuple[str, ...] | None = None) -> ContainerDataset:
        scenes = SceneSettings(cameras, split, fixed=not training, all_views=False)
        return ContainerDataset("text", None, run.seed, length, RenderSettings(size), scenes)

    if plan.workers:
        return [data(plan.size)]
    return [data(plan.size, ("Cl", "Cr")), data(SIDES_SIZE, ("A", "B"))]


def kept(run: Run, split: str) -> Kept:
    """Return the crops of a split, rendered once."""
    crops = Kept([])
    for data in data_of(run, split):
        crops = crops.with_more(rendered(data, run.cache))
    return crops


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test, and write the results."""
    run = start("text", __doc__ or "", PLANS, argv)
    plan = run.plan
    source = data_of(run, "train")[0] if plan.workers else kept(run, "train")
    model = IdentifierReader(width=32 if run.full else 16, seed=run.seed)
    losses = train(model, Feed(source, plan.batch, run.seed, plan.workers), run)

    test = kept(run, "test")
    texts = [
        identifier(crop, target["parts"])
        for crop, target in map(test.__getitem__, range(len(test)))
    ]
    read = model.read([(text.pixels, text.layout) for text in texts])
    groups = {"all": list(range(len(texts)))} | {
        layout: [i for i, text in enumerate(texts) if text.layout == layout] for layout in CANVAS
    }
    found = {
        name: measured([texts[i].code for i in places], [read[i] for i in places])
        for name, places in groups.items()
    }
    rows = [[name, len(groups[name]), *found[name].values()] for name in groups]
    table = Table("Identifiers read, %", ["layout", "crops", *found["all"]], rows)
    charts.loss_curve(losses, run.folder / "text_loss.png")
    shown = list(zip(texts, read, strict=True))[:20]
    if shown:
        canvases = [
            torch.from_numpy(whole_canvas(t.pixels, t.layout)).expand(3, -1, -1) for t, _ in shown
        ]
        titles = [f"{text.code}, read {got}" for text, got in shown]
        charts.pictures(canvases, titles, run.folder / "text_pictures.png", 4)
    conclude(run, [table], {"parameters": parameters(model), **found, "last_loss": losses[-1]})


if __name__ == "__main__":
    main()
