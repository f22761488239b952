"""The page of `fastgen studio` in Chromium, against the command itself."""

import base64
import re
import signal
import subprocess
import sys

import cv2
import numpy as np
import pytest
import yaml
from playwright.sync_api import expect
from screenshots import SLOW_MS, chromium

from fastgen import Config, Generator
from tests.interruptible import interruptible

SIZE = (320, 240)


@pytest.fixture(scope="module")
def address():
    """Address of a running `fastgen studio`, which must end cleanly on Ctrl-C."""
    size = "x".join(map(str, SIZE))
    words = ["studio", "--no-browser", "--seed", "7", "--size", size]
    command = [sys.executable, "-m", "fastgen", *words]
    pipe = subprocess.PIPE
    with interruptible(command, stdout=pipe, stderr=pipe) as server:
        try:
            yield re.search(r"http://127\.0\.0\.1:\d+/\S+/", server.stdout.readline())[0]
        finally:
            server.send_signal(signal.SIGINT)
            _, errors = server.communicate(timeout=60)
    assert server.returncode == 130
    assert errors == "fastgen: stopped\n"


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(address, browser, request):
    """The page with its first picture; anything that the browser reports fails the test."""
    options = getattr(request, "param", {"viewport": {"width": 1280, "height": 900}})
    context = browser.new_context(**options)
    opened = context.new_page()
    reports = []
    opened.on("console", lambda message: reports.append(message.text))
    opened.on("pageerror", lambda error: reports.append(str(error)))
    opened.reports = reports
    opened.goto(address)
    refined(opened)
    yield opened
    context.close()
    assert not reports


def refined(page):
    """Wait until the picture has its chosen quality."""
    expect(page.locator("figcaption").last).to_contain_text("balanced", timeout=SLOW_MS)
    expect(page.locator("body")).not_to_have_class(re.compile("busy"))


def changing(page, action):
    """Do something that draws again, and wait for the refined picture."""
    with page.expect_response(refined_picture, timeout=SLOW_MS):
        action()
    refined(page)
    page.wait_for_timeout(50)


def refined_picture(response):
    return response.url.endswith("/draw") and '"quality":"balanced"' in response.request.post_data


def shot(page, index=0):
    """Pixels of a canvas, int RGBA [H, W, 4]; transparent around the picture."""
    canvas = page.locator("canvas").nth(index)
    data = base64.b64decode(canvas.evaluate("node => node.toDataURL()").partition(",")[2])
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    return pixels[..., [2, 1, 0, 3]].astype(int)


def difference(first, second):
    return np.abs(first - second).mean()


def test_the_picture_has_the_pixels_of_a_generator(page):
    page.get_by_role("button", name="1:1").click()
    shown = shot(page)
    with Generator(Config.preset(), 7, SIZE) as generator:
        image = generator.render(0).image
    covered = shown[..., 3] == 255
    assert covered.sum() == SIZE[0] * SIZE[1]
    np.testing.assert_array_equal(shown[covered][:, :3], image.reshape(-1, 3))


def test_a_slider_changes_picture_yaml_and_command_and_resets(page):
    before = shot(page)
    slider = page.get_by_label("weather fog probability, slider").first
    slider.focus()
    changing(page, lambda: slider.press("End"))
    foggy = shot(page)
    assert difference(before, foggy) > 3
    text = page.locator("#yaml").input_value()
    assert yaml.safe_load(text) == {"weather": {"fog_probability": 1.0}}
    assert "--config studio.yaml" in page.locator("#command").input_value()
    assert page.get_by_label("weather fog probability", exact=True).first.input_value() == "1"
    reset = page.get_by_role("button", name="Reset weather fog probability").first
    changing(page, reset.click)
    assert difference(before, shot(page)) == 0
    assert "--config" not in page.locator("#command").input_value()


def test_an_error_stands_beside_its_control_and_goes_when_it_is_mended(page):
    field = page.get_by_label("damage probability", exact=True).first
    controls = page.locator(".control[data-key='damage.probability']")
    field.fill("7")
    words = "damage.probability: 7 is out of range; give 0 to 1"
    # the key is among the most used ones, and in its section
    alerts = controls.locator("[role=alert]")
    expect(alerts).to_have_text([words, words], timeout=SLOW_MS)
    changing(page, lambda: field.fill("0.5"))
    expect(alerts).to_have_text(["", ""])
    expect(alerts.first).to_be_hidden()
    assert all("422" in each for each in page.reports)  # Chromium reports the refusal
    page.reports.clear()


def test_each_layer_toggles_and_blends(page):
    hdri = page.locator(".hdri input[value=port_afternoon]").first
    changing(page, lambda: hdri.check(force=True))
    before = shot(page)
    for name in ("ids", "damage", "depth", "boxes", "normals", "background"):
        box = page.locator(f"#layer-{name}")
        if name in ("normals", "background"):
            changing(page, box.check)
        else:
            box.check()
        page.wait_for_timeout(300)
        full = difference(before, shot(page))
        assert full > 0.05, name
        page.locator(f".layer:has(#layer-{name}) input[type=range]").fill("0.2")
        assert 0 < difference(before, shot(page)) < full, name
        box.uncheck()
        assert difference(before, shot(page)) == 0, name


def test_the_pointer_and_the_list_show_the_record_of_an_object(page):
    with Generator(Config.preset(), 7, SIZE) as generator:
        sample = generator.render(0)
    place = np.argwhere(sample.ids == 1)
    y, x = place[len(place) // 2]
    frame = page.locator("canvas").bounding_box()
    page.get_by_role("button", name="1:1").click()
    left = frame["x"] + frame["width"] / 2 - SIZE[0] / 2
    top = frame["y"] + frame["height"] / 2 - SIZE[1] / 2
    page.mouse.move(left + x + 0.5, top + y + 0.5)
    expect(page.locator("#pixel")).to_have_text(f"x {x}, y {y}, {sample.depth[y, x]:.2f} m")
    expect(page.locator("#record div", has_text="class name")).to_contain_text("container")
    texts = [item for item in sample.objects if item.bbox and item.text]
    page.mouse.move(1, 1)
    page.locator("#objects").select_option(f"{texts[0].id}")
    expect(page.locator("#record")).to_contain_text(texts[0].text)


def test_keys_zoom_and_pan(page):
    canvas = page.locator("canvas").first
    before = shot(page)
    canvas.focus()
    for key in ("+", "+", "ArrowRight"):
        canvas.press(key)
    assert difference(before, shot(page)) > 1
    canvas.press("0")
    assert difference(before, shot(page)) == 0


def test_two_settings_stand_side_by_side(page):
    page.get_by_role("button", name="Compare A/B").click()
    expect(page.locator("canvas")).to_have_count(2)
    refined(page)
    assert difference(shot(page, 0), shot(page, 1)) == 0
    index = page.get_by_label("Scene index")
    changing(page, lambda: index.fill("5"))
    assert difference(shot(page, 0), shot(page, 1)) > 5
    page.get_by_label("Edit A").check()
    assert index.input_value() == "0"
    page.get_by_role("button", name="Compare A/B").click()
    expect(page.locator("canvas")).to_have_count(1)


def test_the_search_leaves_matching_keys(page):
    page.get_by_label("Search keys").fill("rust scale")
    shown = page.locator(".control:visible")
    expect(shown).to_have_count(1)
    assert shown.get_attribute("data-key") == "surface.rust_scale_mm"
    page.get_by_label("Search keys").fill("")
    assert shown.count() > 1


def test_a_preset_brings_its_cameras(page):
    changing(page, lambda: page.get_by_label("Preset").select_option("crane"))
    names = page.get_by_label("Camera").locator("option").all_inner_texts()
    assert names == list(Config.preset("crane").cameras)
    assert "--preset crane" in page.locator("#command").input_value()


def test_every_input_has_a_label_and_every_section_opens_by_key(page):
    for summary in page.locator("#controls summary").all():
        if not summary.locator("xpath=..").evaluate("node => node.open"):
            summary.press("Enter")
    inputs = page.locator("input, select, textarea, button")
    assert inputs.count() > 400
    unnamed = inputs.evaluate_all(
        "nodes => nodes.filter(n => !n.labels?.length && !n.ariaLabel && !n.textContent.trim())"
        ".map(n => n.outerHTML)"
    )
    assert not unnamed


@pytest.mark.parametrize(
    "page",
    [
        {"viewport": {"width": width, "height": 860}, "color_scheme": scheme}
        for width, scheme in ((400, "light"), (1280, "dark"))
    ],
    indirect=True,
    ids=("400 light", "1280 dark"),
)
def test_the_page_fits_its_window_in_both_color_schemes(page, request):
    width = page.viewport_size["width"]
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    box = page.locator("canvas").bounding_box()
    assert box["width"] > 0.6 * min(width, 1000)
    back = page.evaluate("getComputedStyle(document.body).backgroundColor")
    text = page.evaluate("getComputedStyle(document.body).color")
    light, dark = (sum(map(int, re.findall(r"\d+", color)[:3])) / 765 for color in (back, text))
    assert (light > dark) == ("light" in request.node.name)
    assert abs(light - dark) > 0.6
