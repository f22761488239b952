"""Arrays kept on disk from one run to the next. Losing them costs time only."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def default_folder() -> Path:
    """$XDG_CACHE_HOME/fastgen or ~/.cache/fastgen."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG base directory specification asks to ignore relative paths
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "fastgen"


def read(entry: Path) -> dict[str, NDArray[np.generic]]:
    """The arrays of an entry by name; none where it is absent or damaged."""
    try:
        with np.load(entry, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except Exception:  # an archive can be damaged in many ways
        return {}


def write(entry: Path, arrays: Mapping[str, Any], compress: bool = False) -> None:
    """Keep arrays by name as an entry, whole or not at all; none without a writable folder."""
    temporary = None
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        # several workers may write the same entry: each its own file, and the last rename wins
        with tempfile.NamedTemporaryFile(
            dir=entry.parent, prefix=entry.stem, suffix=".part", delete=False
        ) as file:
            temporary = Path(file.name)
            (np.savez_compressed if compress else np.savez)(file, **arrays)
        temporary.replace(entry)
    except OSError:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
