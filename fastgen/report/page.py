"""The report as one file of HTML that needs no network and no other file.

The charts are a few hundred lines of this project's own JavaScript and CSS, because the reports of
small datasets are small: plotly.js alone would add 4.6 MB to each, and draws neither boxes over
images nor tables. The page works from a file:// address.

Names and texts in a dataset are not trusted. They are in a block of JSON whose `<`, `>` and `&` are
escaped, the script writes them as text and never as HTML, and the page's content security policy
allows no other script and no address.
"""

import base64
import hashlib
import html
import json
from pathlib import Path
from typing import Any

from fastgen.dataset.storage import Remote, storage_of
from fastgen.errors import OutputError
from fastgen.files.images import write
from fastgen.report.content import report_content

_HERE = Path(__file__).parent

_ESCAPES = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}

_PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}: dataset report</title>
<style>{style}</style>
<main id="page"><noscript>This report needs JavaScript.</noscript></main>
<script type="application/json" id="content">{content}</script>
<script>{script}</script>
</html>
"""


def report_path(out: str) -> Path:
    """Return the usual place of a dataset's report: beside its folder.

    Raises:
        OutputError: `out` is an address.
    """
    if isinstance(storage_of(out), Remote):
        raise OutputError(f"{out}: is an address; give a file for the report with -o")
    folder = Path(out).resolve()
    return folder.with_name(f"{folder.name}.report.html")


def write_report(out: str, path: Path | None = None) -> tuple[Path, int]:
    """Write the report of a dataset.

    Args:
        out: Folder or address of a finished dataset.
        path: File to write; by default `report_path(out)`.

    Returns:
        The file, and the number of pieces of advice in it.

    Raises:
        OutputError: `out` is not a finished dataset or is damaged, or the file cannot be written.
    """
    place = report_path(out) if path is None else path
    if place.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{place}: give a file name that ends in .html")
    if not isinstance(storage_of(out), Remote) and Path(out).resolve() in place.resolve().parents:
        raise OutputError(
            f"{place}: is inside of the dataset, where fastgen verify would report it; give a file "
            "outside"
        )
    content = report_content(out)
    write(place, page(content))
    return place, len(content["advice"])


def page(content: dict[str, Any]) -> str:
    """Return the page that shows `content`, as `report_content` returns it."""
    style = (_HERE / "page.css").read_text(encoding="utf-8")
    script = "\n".join(
        (_HERE / name).read_text(encoding="utf-8") for name in ("charts.js", "page.js")
    )
    policy = (
        f"default-src 'none'; img-src data:; style-src {_hash(style)}; script-src {_hash(script)}"
    )
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return _PAGE.format(
        policy=policy,
        title=html.escape(content["title"]),
        style=style,
        content=text.translate(_ESCAPES),
        script=script,
    )


def _hash(text: str) -> str:
    """Return the source expression that allows an inline element with this text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
