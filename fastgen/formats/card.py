"""Dataset card: README.md whose header tells Hugging Face's `datasets` the files of each split."""

import json
from collections.abc import Iterator, Sequence

_SPLIT_NAMES = {"train": "train", "val": "validation", "test": "test"}
"""Name of each split on the Hub."""


def card(pattern: str, splits: Sequence[str]) -> Iterator[str]:
    """Yield the text of a dataset card.

    Args:
        pattern: Files of a split relative to the dataset, with SPLIT for its name, as in
            SPLIT-*.tar.
        splits: Splits that have images.
    """
    yield "---\nlicense: cc0-1.0\ntags:\n- synthetic\nconfigs:\n"
    yield "- config_name: default\n  data_files:\n"
    for split in splits:
        path = json.dumps(pattern.replace("SPLIT", split))
        yield f"  - split: {_SPLIT_NAMES[split]}\n    path: {path}\n"
    yield (
        "---\n\n# Synthetic images of shipping containers\n\n"
        "Rendered by fastgen, with labels from the geometry. `dataset.json` holds the seed and the "
        "configuration\nfrom which the same images can be made again.\n"
    )
