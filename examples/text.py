"""Identifiers: train a small convolutional network with CTC to read them from crops.

    python examples/text.py [--full]

Reports by layout how many identifiers are read without a mistake, the character error rate, and
what the check digit of ISO 6346 catches. Training uses single letters of identifiers in columns
first, and whole identifiers after that. Needs fastgen[examples]. --full trains a wider network on a
GPU while workers render.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import torch
from common import charts
from common.data import Feed, Kept, in_order, rendered
from common.run import Learner, Plan, Run, Table, conclude, parameters, start, train
from common.strips import letters, strip, varied
from torch import nn
from torch.nn import functional
from torch.utils.data import Dataset

from fastgen.decals.iso6346 import check_digit
from fastgen.errors import ConfigError
from fastgen.torch import ContainerDataset, ItemSettings, RenderSettings, SceneSettings

PLANS = {
    "cpu": Plan(images=800, test_images=200, size=(640, 640), batch=16, passes=16, rate=4e-3),
    "full": Plan(
        images=8000, test_images=1000, size=(1280, 1280), batch=16, passes=20, rate=1e-3, workers=12
    ),
    "smoke": Plan(images=4, test_images=4, size=(640, 640), batch=4, passes=1, rate=1e-3),
}
"""Images of the end cameras; on a CPU, as many of the side cameras are added."""

SIDES_SIZE = (1600, 480)
"""Image size of the side cameras on a CPU, so that letters are as large as in the end cameras."""

LETTERS = Plan(images=800, test_images=0, size=(0, 0), batch=240, passes=3, rate=4e-3)
"""Training on single letters, which comes first. --full renders this many images for it, once."""

CHARACTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"


class Size(nn.Module):
    """Absolute values, so that a filter responds the same to light on dark and dark on light."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the absolute values of a tensor."""
        return x.abs()


class Reader(Learner):
    """Network from strips to characters.

    It sees only about three letters around each column. A recurrent layer instead of the last
    convolution memorized the few owner and size codes, and read a clear 45G1 as 42G1.

    Args:
        width: Channels of the first layer.
    """

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        last = 8 * width
        self.features = nn.Sequential(
            *(_conv(1, width), Size(), nn.BatchNorm2d(width), nn.MaxPool2d(2)),
            *(_conv(width, 2 * width), nn.BatchNorm2d(2 * width), nn.ReLU(), nn.MaxPool2d(2)),
            *(_conv(2 * width, 4 * width), nn.BatchNorm2d(4 * width), nn.ReLU()),
            nn.MaxPool2d((2, 1)),
            # covers the full height, because the position of a stroke distinguishes 6 from 9
            *(_conv(4 * width, last, padding=(0, 1)), nn.BatchNorm2d(last), nn.ReLU()),
        )
        self.context = nn.Conv1d(last, last, 5, padding=2, bias=False)
        self.norm = nn.BatchNorm1d(last)
        self.letters = nn.Conv1d(last, len(CHARACTERS) + 1, 1)

    def forward(self, strips: torch.Tensor) -> torch.Tensor:
        """Return log probabilities [B, T, 37] of strips uint8 [B, 1, H, W]; class 0 is CTC's
        blank."""
        grey = strips.to(self.letters.weight.device).float()
        if self.training:
            grey = varied(grey)
        mean, deviation = grey.mean((2, 3), keepdim=True), grey.std((2, 3), keepdim=True)
        columns = self.features((grey - mean) / (deviation + 1)).squeeze(2)
        surrounded = functional.relu(self.norm(self.context(columns))) + columns
        shares: torch.Tensor = self.letters(surrounded).transpose(1, 2).log_softmax(-1)
        return shares

    def loss(self, images: list[torch.Tensor], targets: list[str]) -> torch.Tensor:
        """Return the CTC loss of a batch of strips; spaces in the texts are ignored."""
        words = [[CHARACTERS.index(c) + 1 for c in joined(text)] for text in targets]
        shares = self(torch.stack(images))
        return functional.ctc_loss(
            shares.transpose(0, 1),
            torch.tensor([k for word in words for k in word], device=shares.device),
            torch.full((len(words),), shares.shape[1]),
            torch.tensor([len(word) for word in words]),
        )

    @torch.no_grad()
    def read(self, images: list[torch.Tensor]) -> list[str]:
        """Return the text of each strip, from the best character at each column."""
        return [decoded(best) for best in self(torch.stack(images)).argmax(2).tolist()]


class Pictures(Dataset[Any]):
    """Strips or letters, with their texts."""

    def __init__(self, items: Sequence[tuple[torch.Tensor, str]]) -> None:
        self._items = items

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, position: int) -> tuple[torch.Tensor, str]:
        return self._items[position]


def strips_in(crops: Kept) -> Pictures:
    """Return the crops as strips."""
    return Pictures([(strip(crop), text) for crop, text in _each(crops)])


def letters_in(crops: Kept) -> Pictures:
    """Return the letters of the crops that are laid out in columns."""
    return Pictures(
        [
            pair
            for crop, text in _each(crops)
            for pair in zip(letters(crop), joined(text), strict=False)
        ]
    )


def decoded(best: Sequence[int]) -> str:
    """Decode CTC's best path: merge repeats and drop the blank 0."""
    kept = [k for k, before in zip(best, [0, *best], strict=False) if k and k != before]
    return "".join(CHARACTERS[k - 1] for k in kept)


def joined(text: str) -> str:
    """Return a text without spaces, which only describe its layout."""
    return text.replace(" ", "")


def layout_of(text: str) -> str:
    """Return 'columns' or 'rows'. An identifier written in a column has no space inside."""
    return "columns" if text.count(" ") == 1 else "rows"


def edit_distance(a: str, b: str) -> int:
    """Return the Levenshtein distance (1966): fewest insertions, deletions and substitutions."""
    row = list(range(len(b) + 1))
    for i, left in enumerate(a, start=1):
        before, row = row, [i]
        for j, right in enumerate(b, start=1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (left != right)))
    return row[-1]


def checks(text: str) -> bool:
    """Return whether the text starts with a whole identifier with the correct check digit."""
    try:
        return len(text) == 15 and str(check_digit(text[:10])) == text[10]
    except ConfigError:
        return False


def measured(texts: Sequence[str], read: Sequence[str]) -> dict[str, float]:
    """Score texts that were read.

    Returns:
        Percentages: exact matches, character error rate, reads with a correct check digit, and
        exact matches among these. nan where there is nothing to divide by.
    """
    pairs = [(joined(text), got) for text, got in zip(texts, read, strict=True)]
    exact = [wanted == got for wanted, got in pairs]
    passed = [right for right, (_, got) in zip(exact, pairs, strict=True) if checks(got)]
    wrong = sum(edit_distance(got, wanted) for wanted, got in pairs)

    def percent(part: int, whole: int) -> float:
        return 100 * part / whole if whole else float("nan")

    return {
        "exact": percent(sum(exact), len(pairs)),
        "character errors": percent(wrong, sum(len(wanted) for wanted, _ in pairs)),
        "check digit right": percent(len(passed), len(pairs)),
        "exact among these": percent(sum(passed), len(passed)),
    }


def strips_of(crops: Any, target: dict[str, Any]) -> tuple[list[torch.Tensor], dict[str, Any]]:
    """Convert the crops of an image to strips, as `transforms` of a dataset."""
    return [strip(crop) for crop in crops], target


def data_of(
    run: Run, split: str, transforms: Callable[..., Any] | None = None
) -> list[ContainerDataset]:
    """Return datasets of end and side cameras, with a new container in each image.

    With --full, one dataset covers all cameras.
    """
    plan = run.plan
    training = split == "train"
    length = plan.images if training else plan.test_images
    items = ItemSettings(transforms=transforms)

    def data(size: tuple[int, int], cameras: tuple[str, ...] | None = None) -> ContainerDataset:
        scenes = SceneSettings(cameras, split, fixed=not training, all_views=False)
        render = RenderSettings(size)
        return ContainerDataset("text", None, run.seed, length, render, scenes, items)

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
    source: Any
    if plan.workers:
        source = data_of(run, "train", strips_of)[0]
        crops = kept(replace(run, plan=replace(plan, images=LETTERS.images)), "train")
    else:
        crops = kept(run, "train")
        source = strips_in(crops)
    model = Reader(width=48 if run.full else 16)
    # letters first, because CTC can take longer than this whole training to locate them
    single = letters_in(crops)
    if len(single):
        train(model, Feed(single, LETTERS.batch, run.seed), replace(run, plan=LETTERS))
    losses = train(model, Feed(source, plan.batch, run.seed, plan.workers), run)

    test = strips_in(kept(run, "test"))
    texts = [test[i][1] for i in range(len(test))]
    read = [one for images, _ in in_order(test, 64) for one in model.read(images)]
    parts = {"all": range(len(texts))} | {
        name: [i for i, text in enumerate(texts) if layout_of(text) == name]
        for name in ("rows", "columns")
    }
    found = {
        name: measured([texts[i] for i in places], [read[i] for i in places])
        for name, places in parts.items()
    }
    rows = [[name, len(parts[name]), *found[name].values()] for name in parts]
    table = Table("Identifiers read, %", ["layout", "crops", *found["all"]], rows)
    charts.loss_curve(losses, run.folder / "text_loss.png")
    titles = [f"{joined(texts[i])}, read {read[i]}" for i in range(min(20, len(test)))]
    strips = [test[i][0].expand(3, -1, -1) for i in range(len(titles))]
    if strips:
        charts.pictures(strips, titles, run.folder / "text_pictures.png", 2, inches=4.5)
    conclude(run, [table], {"parameters": parameters(model), **found, "last_loss": losses[-1]})


def _conv(before: int, after: int, padding: int | tuple[int, int] = 1) -> nn.Conv2d:
    return nn.Conv2d(before, after, 3, padding=padding, bias=False)


def _each(crops: Kept) -> Iterator[tuple[torch.Tensor, str]]:
    return (crops[i] for i in range(len(crops)))


if __name__ == "__main__":
    main()
