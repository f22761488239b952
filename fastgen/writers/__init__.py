"""Output formats. A writer is one small class; adding a format touches one file and this list."""

from typing import Protocol

from fastgen.sample import Sample


class Writer(Protocol):
    """Writes samples as they come; one instance a process."""

    def add(self, sample: Sample, split: str, stem: str) -> None:
        """Write all files of one sample. When it returns, the sample is whole on disk."""

    def has(self, split: str, stem: str) -> bool:
        """Whether a sample was written whole before."""

    def finish(self) -> dict[str, dict[str, int]]:
        """Write the files that span samples. Returns counts by split."""
