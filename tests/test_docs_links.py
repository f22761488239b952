"""Relative links of the documentation, on a code host and in the documentation site."""

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote, urlsplit

from markdown_it import MarkdownIt

ROOT = Path(__file__).parent.parent
PAGES = sorted(page for glob in ("*.md", "docs/*.md", "assets/**/*.md") for page in ROOT.glob(glob))


def inline_tokens(page):
    blocks = MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))
    return [(block, before.type) for before, block in pairwise(blocks) if block.children]


def anchors(page):
    """Return the anchors that GitHub gives the headings of a page."""
    found = []
    for block, opened_by in inline_tokens(page):
        if opened_by == "heading_open":
            text = "".join(token.content for token in block.children)
            slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            found.append(slug + (f"-{found.count(slug)}" if slug in found else ""))
    return found


def links(page):
    targets = [
        str(token.attrs.get("href", token.attrs.get("src")))
        for block, _ in inline_tokens(page)
        for token in block.children
        if token.type in ("link_open", "image")
    ]
    return [target for target in targets if not urlsplit(target).scheme]


def dead(page):
    """Return the relative links of a page without a file or, in a page, without an anchor."""
    found = []
    for link in links(page):
        path, _, anchor = unquote(link).partition("#")
        target = page.parent / path if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            found.append(link)
    return found


def test_relative_links_and_anchors_resolve_on_a_code_host():
    assert sum(len(links(page)) for page in PAGES) > 80
    assert {page.name: dead(page) for page in PAGES if dead(page)} == {}


def test_links_without_a_file_or_an_anchor_are_found(tmp_path):
    (tmp_path / "b.md").write_text("## A `key`, and one\n## Twice\n## Twice\n")
    page = tmp_path / "a.md"
    page.write_text(
        "[1](b.md#a-key-and-one) [2](b.md#a-key) [3](c.md) ![4](d.png) [5](#here) [6](b.md#twice-1)"
        "\n\n| a |\n| - |\n| [7](e.md) |\n\n[8]: f.md\n[8] `[9](g.md)` https://example.org/h.md\n"
    )
    assert dead(page) == ["b.md#a-key", "c.md", "d.png", "#here", "e.md", "f.md"]


def test_the_site_builds_without_a_warning_and_loads_nothing_from_other_hosts(tmp_path):
    # with --quiet, --strict would not count warnings
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", tmp_path]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "INFO" in run.stderr
    pages = {path.relative_to(tmp_path).as_posix(): path for path in tmp_path.rglob("*.html")}
    assert 'id="fastgen.Generator.render"' in pages["api/generator.html"].read_text()
    assert 'href="docs/stability.html#files-and-input"' in pages["SECURITY.html"].read_text()
    loaded = re.compile(r'<(?:script|link|img)[^>]*(?:src|href)="(?:https?:)?//')
    assert [name for name, path in pages.items() if loaded.search(path.read_text())] == []
