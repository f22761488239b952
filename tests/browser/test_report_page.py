"""The page of `fastgen report` in Chromium, from a file and without network."""

import shutil

import pytest
from screenshots import chromium

from fastgen.report.page import write_report


@pytest.fixture(scope="module")
def report(report_dataset, tmp_path_factory):
    out = shutil.copytree(report_dataset, tmp_path_factory.mktemp("browser") / "out")
    path, _ = write_report(str(out))
    shutil.rmtree(out)  # the page needs nothing of it
    return path


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser, report, request):
    """The report, open in a window; the test fails if the page logs anything."""
    width, scheme = getattr(request, "param", (1280, "light"))
    opened = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    said = []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda asked: said.append(asked.url) if web(asked.url) else None)
    opened.goto(report.as_uri())
    yield opened
    opened.close()
    assert said == []


wide_and_narrow = pytest.mark.parametrize(
    "page", [(1280, "light"), (400, "dark")], indirect=True, ids=["wide", "narrow"]
)


def web(url):
    return not url.startswith(("file:", "data:"))


def shown_boxes(page, name):
    return page.evaluate(
        "(name) => [...document.querySelectorAll(`.sheet [data-class='${name}']`)]"
        ".filter((box) => getComputedStyle(box).display !== 'none').length",
        name,
    )


@wide_and_narrow
def test_the_page_fits_its_window(page):
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    tables = "[...document.querySelectorAll('.scroll')]"
    assert page.evaluate(f"{tables}.every((table) => table.scrollWidth <= table.clientWidth)")
    loaded = "[...document.images].every((image) => image.naturalWidth > 0)"
    assert page.evaluate(loaded)
    assert page.locator(".tile").count() == 8


def test_boxes_of_a_class_toggle(page):
    before = shown_boxes(page, "container")
    assert before == 8
    page.get_by_label("container", exact=True).uncheck()
    assert shown_boxes(page, "container") == 0
    assert shown_boxes(page, "text") > 0
    page.get_by_role("button", name="No boxes").click()
    assert shown_boxes(page, "text") == 0
    page.get_by_role("button", name="All boxes").click()
    assert shown_boxes(page, "container") == before


@wide_and_narrow
def test_images_open_large_and_keys_turn_the_pages(page):
    tile = page.locator(".tile").first
    small = tile.locator("img").bounding_box()["width"]
    tile.click()
    dialog = page.locator("dialog")
    stem = dialog.locator("img").get_attribute("alt")
    assert dialog.is_visible()
    assert dialog.locator("tbody tr").count() == dialog.locator("rect").count() > 0
    assert dialog.locator("img").bounding_box()["width"] >= min(small, 320)
    page.keyboard.press("ArrowRight")
    assert dialog.locator("img").get_attribute("alt") != stem
    page.keyboard.press("Escape")
    assert not dialog.is_visible()


@wide_and_narrow
def test_boxes_lie_over_what_they_label(page):
    frame = page.locator(".tile img").first.bounding_box()
    for box in page.locator(".tile").first.locator("rect").all():
        place = box.bounding_box()
        assert place["x"] >= frame["x"] - 2
        assert place["y"] >= frame["y"] - 2
        assert place["x"] + place["width"] <= frame["x"] + frame["width"] + 2
        assert place["y"] + place["height"] <= frame["y"] + frame["height"] + 2


def pixels(page, section):
    return page.evaluate(f"document.querySelector('#{section} canvas').toDataURL()")


def test_maps_change_with_class_and_camera(page):
    before = pixels(page, "places")
    select = page.locator("#places").get_by_label("Class")
    select.select_option(label="container")
    container = pixels(page, "places")
    assert container != before
    page.locator("#places").get_by_label("Camera").select_option(label="Cr")
    assert pixels(page, "places") != container
    sizes = pixels(page, "sizes")
    page.locator("#sizes").get_by_label("Class").select_option(label="container")
    assert pixels(page, "sizes") != sizes


def test_cells_of_maps_say_their_value(page):
    page.locator("#places").get_by_label("Class").select_option(label="container")
    canvas = page.locator("#places canvas")
    canvas.scroll_into_view_if_needed()
    canvas.hover()  # its middle
    note = page.locator("#places p.small").inner_text()
    assert note.endswith(": 8 boxes")


@wide_and_narrow
def test_cells_of_the_table_of_pairs_say_their_value(page):
    row = page.locator("#together tbody tr", has_text="container").first
    # every image shows a container, so the diagonal is 100 %
    row.locator("td").nth(
        page.locator("#together tbody th").all_inner_texts().index("container")
    ).hover()
    note = page.locator("#together p.small").inner_text()
    assert note == "100 % of the images with container also show container"


@wide_and_narrow
def test_letters_of_charts_are_not_scaled_down(page):
    scales = page.evaluate(
        "[...document.querySelectorAll('svg.chart')]"
        ".map((chart) => chart.getBoundingClientRect().width / chart.viewBox.baseVal.width)"
    )
    assert len(scales) == 3
    assert min(scales) > 0.85


@wide_and_narrow
def test_bars_have_lengths_of_their_counts(page):
    widths = "[...document.querySelectorAll('#classes .bars')].at(-1).querySelectorAll('.bar')"
    lengths = page.evaluate(
        f"[...{widths}].map((bar) => [...bar.children].reduce("
        "(total, part) => total + part.getBoundingClientRect().width, 0) / bar.clientWidth)"
    )
    values = page.evaluate(
        "[...[...document.querySelectorAll('#classes .bars')].at(-1)"
        ".querySelectorAll('.value')].map((value) => Number(value.textContent))"
    )
    assert max(values) > 0
    for length, value in zip(lengths, values, strict=True):
        assert length == pytest.approx(value / max(values), abs=0.02)
    page.locator("#classes").get_by_label("logarithmic scale").last.check()
    longer = page.evaluate(
        f"[...{widths}].filter((bar) => bar.children[0].clientWidth > bar.clientWidth / 3).length"
    )
    assert longer > sum(value > max(values) / 3 for value in values)


def test_every_section_is_linked(page):
    links = page.locator("nav a").all()
    assert len(links) >= 8
    for link in links:
        assert page.locator(link.get_attribute("href")).count() == 1
