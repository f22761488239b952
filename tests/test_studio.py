"""The server of `fastgen studio`: what it answers, and what it refuses."""

import http.client
import json
import re
import shlex
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
import yaml
from starlette.testclient import TestClient

from fastgen import Config, ConfigError, Generator, OutputError, RenderSettings
from fastgen.classes import BACKGROUND_ID
from fastgen.cli.main import main
from fastgen.config.assignments import changed
from fastgen.light.hdri import bundled_hdris
from fastgen.studio.changes import bases, values_of
from fastgen.studio.drawing import Drawing, Superseded, Wanted
from fastgen.studio.server import Studio, listening
from tests.interruptible import interruptible

SIZE = (160, 128)
TOKEN = "secret-token"
BASE = f"http://127.0.0.1:8000/{TOKEN}/"
FOG = {"weather.fog_probability": "1.0", "weather.visibility_mm": "[20000, 20000]"}
WANTED = {"side": "a", "preset": "seafront", "seed": 7, "index": 3, "camera": "Cr"}


@pytest.fixture(scope="module")
def client():
    with Drawing(RenderSettings(SIZE)) as drawing:
        app = Studio(
            drawing, RenderSettings(SIZE), bases("seafront", Config.preset("seafront"), ""), 7
        ).app(TOKEN)
        yield TestClient(app, base_url=BASE)


def draw(client, **wanted):
    answer = client.post("draw", content=json.dumps({**WANTED, **wanted}))
    assert answer.status_code == 200, answer.text
    return answer.json()


def image(client, number, layer):
    answer = client.get(f"pictures/{number}/{layer}")
    assert answer.status_code == 200, answer.text
    return np.frombuffer(answer.content, np.uint8).reshape(*SIZE[::-1], 4)


# ---- who may ask


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", ""]
)
def test_foreign_hosts_are_refused(client, host):
    answer = client.get("controls", headers={"host": host})
    assert answer.status_code == 403
    assert answer.text.startswith("host: ")


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:9", "null"])
def test_other_origins_are_refused(client, origin):
    answer = client.post("draw", content=json.dumps(WANTED), headers={"origin": origin})
    assert answer.status_code == 403
    assert answer.text.startswith("origin: ")


def test_the_page_itself_may_ask(client):
    headers = {"origin": "http://127.0.0.1:8000", "host": "127.0.0.1:8000"}
    assert client.get("controls", headers=headers).status_code == 200
    headers = {"origin": "http://localhost:8000", "host": "localhost:8000"}
    assert client.get("controls", headers=headers).status_code == 200


@pytest.mark.parametrize("path", ["/", "/controls", "/wrong/controls", f"/{TOKEN}x/", "//controls"])
def test_addresses_without_the_token_are_refused(client, path):
    answer = client.get(f"http://127.0.0.1:8000{path}")
    assert answer.status_code == 403
    assert answer.text.startswith("token: ")


def test_files_outside_the_page_are_not_served(client):
    for path in ("../server.py", "%2e%2e/server.py", "..%2fserver.py", "__init__.py"):
        assert client.get(path).status_code in (403, 404)


def test_the_page_loads_nothing_from_elsewhere(client):
    page = client.get("")
    assert page.headers["content-security-policy"].startswith("default-src 'self'")
    for name in ("main.js", "side.js", "viewer.js", "controls.js", "server.js", "studio.css", ""):
        answer = client.get(name)
        assert answer.status_code == 200
        assert "//" not in answer.text.replace("// ", "").replace("http://www.w3.org/", "")


# ---- pictures


def test_the_picture_is_that_of_a_generator_of_the_same_configuration(client):
    drawn = draw(client, changes=FOG, quality="balanced")
    config = Config.from_values(
        {"weather": {"fog_probability": 1.0, "visibility_mm": [20000, 20000]}},
        Config.preset("seafront"),
    )
    with Generator(config, seed=7, size=SIZE) as generator:
        sample = generator.render(3, "Cr")
    shown = image(client, drawn["number"], "colour")
    np.testing.assert_array_equal(shown[..., :3], sample.image)
    assert (shown[..., 3] == 255).all()
    plain = draw(client, quality="balanced")
    assert (image(client, plain["number"], "colour")[..., :3] != sample.image).mean() > 0.5
    assert [item["id"] for item in drawn["objects"]] == [item.id for item in sample.objects]
    boxes = [item["bbox"] and tuple(item["bbox"]) for item in drawn["objects"]]
    assert boxes == [item.bbox for item in sample.objects]
    assert [item["text"] for item in drawn["objects"]] == [item.text for item in sample.objects]


def test_a_changed_mask_threshold_changes_the_damage_image(client):
    damaged = {"damage.probability": "1", "damage.count": "9"}
    masks = []
    for threshold in (1.0, 200.0):
        changes = {**damaged, "damage.mask_threshold_mm": str(threshold)}
        drawn = draw(client, index=17, camera="A", changes=changes)
        masks.append((pixels(client, drawn["number"])["damage"] >= 201).sum())
        config = changed(Config.preset(), values_of(changes))
        with Generator(config, 7, SIZE, quality="draft") as generator:
            assert (generator.render(17, "A").damage >= 201).sum() == masks[-1]
    assert masks[0] > masks[1]


def pixels(client, number):
    data = client.get(f"pictures/{number}/pixels").content
    count = SIZE[0] * SIZE[1]
    kinds = {"ids": "<u2", "damage": "<u2", "background": "<u2", "depth": "<f4"}
    record = np.dtype([(name, kind, count) for name, kind in kinds.items()])
    (values,) = np.frombuffer(data, record)
    return {name: values[name].reshape(SIZE[::-1]) for name in kinds}


def test_layers_show_the_values_of_each_pixel(client):
    port = {"environment.names": "[port_afternoon]"}
    drawn = draw(client, changes=port, normals=True, background=True)
    values = pixels(client, drawn["number"])
    ids, depth = values["ids"], values["depth"]
    assert {item["id"] for item in drawn["objects"]} >= set(np.unique(ids[ids > 0]).tolist())
    assert len(np.unique(ids)) > 3
    assert ((depth < np.inf) == (ids > 0)).mean() > 0.99
    layer = image(client, drawn["number"], "ids")
    np.testing.assert_array_equal(layer[..., 3] > 0, ids > 0)
    colors = {int(i): {tuple(c) for c in layer[ids == i].tolist()} for i in np.unique(ids)}
    assert all(len(each) == 1 for each in colors.values())
    assert len(set.union(*colors.values())) == len(colors)
    np.testing.assert_array_equal(
        image(client, drawn["number"], "depth")[..., 3] > 0, depth < np.inf
    )
    normals = image(client, drawn["number"], "normals")
    seen = normals[..., 3] > 0
    length = np.linalg.norm(normals[seen][:, :3] / 127.5 - 1, axis=1)
    assert seen.any()
    assert np.median(np.abs(length - 1)) < 0.02
    shown = np.unique(values["background"][values["background"] > 0].astype(int)) + BACKGROUND_ID
    assert set(shown.tolist()) <= {i["id"] for i in drawn["objects"] if i["background"]}
    assert shown.size
    assert (image(client, drawn["number"], "background")[..., 3] > 0).sum() == (
        values["background"] > 0
    ).sum()


def test_a_layer_that_was_not_rendered_is_refused_in_words(client):
    drawn = draw(client)
    for layer in ("normals", "background", "colours"):
        answer = client.get(f"pictures/{drawn['number']}/{layer}")
        assert answer.status_code == 422
        assert answer.json()["error"].startswith("layer: ")
    assert client.get("pictures/999999/colour").status_code == 404


# ---- values


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"changes": {"surface.rust_coverage": "2"}}, "surface.rust_coverage: 2 is out of range"),
        ({"changes": {"surface.rust_coverage": "null"}}, "surface.rust_coverage: expected"),
        ({"changes": {"surface.rust_coverage": "[1"}}, "surface.rust_coverage: not YAML"),
        ({"changes": {"surface.rust_coverage": 0.5}}, "surface.rust_coverage: expected YAML text"),
        ({"changes": {"surface.rust": "1"}}, "surface.rust: unknown key"),
        ({"changes": {"surface": "3", "surface.bleach": "1"}}, "surface.bleach: surface is"),
        ({"changes": {"surface.bleach": "1", "surface": "{}"}}, "surface.bleach: surface is"),
        ({"changes": {"cameras.A.focal_mm": "0"}}, "cameras.A.focal_mm: 0 is out of range"),
        ({"changes": {"environment.names": "[nowhere]"}}, "environment.names: HDRI 'nowhere'"),
        ({"changes": []}, "changes: "),
        ({"seed": -1}, "seed: "),
        ({"index": None}, "index: "),
        ({"index": "3"}, "index: "),
        ({"camera": "Z"}, "camera: "),
        ({"camera": {}}, "camera: "),
        ({"quality": "best"}, "quality: "),
        ({"refined": "best"}, "quality: "),
        ({"material": "wood"}, "layer: "),
        ({"preset": "harbour"}, "preset: "),
        ({"preset": []}, "preset: "),
        ({"side": "c"}, "side: "),
    ],
)
def test_bad_values_are_refused_with_the_name_of_the_value(client, wanted, words):
    answer = client.post("draw", content=json.dumps({**WANTED, **wanted}))
    assert answer.status_code == 422
    assert answer.json()["error"].startswith(words)


def test_bodies_that_are_no_objects_or_too_long_are_refused(client):
    assert client.post("draw", content="[1]").status_code == 400
    assert client.post("draw", content="{").status_code == 400
    assert client.post("draw", content=" " * (1 << 20)).status_code == 413


def test_the_command_and_the_file_make_the_shown_configuration(client, tmp_path):
    drawn = draw(client, changes=FOG, refined="fine")
    words = shlex.split(drawn["command"])
    assert words[:3] == ["fastgen", "generate", "OUT"]
    options = dict(zip(words[3::2], words[4::2], strict=True))
    assert options["--seed"] == "7"
    assert options["--size"] == "160x128"
    assert options["--quality"] == "fine"
    file = tmp_path / options["--config"]
    file.write_text(drawn["yaml"], encoding="utf-8")
    loaded = Config.load(file, Config.preset(options["--preset"]))
    assert loaded == changed(Config.preset(), values_of(FOG))
    weather = {"fog_probability": 1.0, "visibility_mm": 20000.0}
    assert yaml.safe_load(drawn["yaml"]) == {"weather": weather}
    plain = draw(client)
    assert plain["yaml"] == ""
    assert "--config" not in plain["command"]


# ---- pictures of HDRIs


def test_each_hdri_has_a_thumbnail(client):
    offered = client.get("controls").json()["hdris"]
    assert set(offered) == set(bundled_hdris())
    for name in ("port_afternoon", "city"):
        data = client.get(f"hdri/{name}.jpg").content
        small = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert small.shape == (96, 192, 3)
        assert 40 < small.mean() < 200
    assert client.get("hdri/nowhere.jpg").status_code == 422


# ---- the drawing thread


def test_only_the_newest_of_the_waiting_requests_is_drawn():
    started, go_on = threading.Event(), threading.Event()
    drawn = []

    def first():
        started.set()
        go_on.wait()
        drawn.append("first")
        raise ConfigError("seed: refused")

    def later(name):
        drawn.append(name)
        return Wanted(Config.preset())

    with Drawing(RenderSettings((64, 64))) as drawing:
        refused = drawing.draw("a", first)
        started.wait()
        futures = [drawing.draw("a", lambda k=k: later(k)) for k in range(5)]
        other = drawing.draw("b", lambda: later("b"))
        go_on.set()
        with pytest.raises(ConfigError, match="seed: refused"):
            refused.result()
        for future in futures[:-1]:
            with pytest.raises(Superseded):
                future.result()
        assert futures[-1].result().sample.image.shape == (64, 64, 3)
        assert other.result().sample.image.shape == (64, 64, 3)
    assert drawn == ["first", 4, "b"]


def test_closing_ends_what_still_waits():
    started, go_on = threading.Event(), threading.Event()

    def blocked():
        started.set()
        go_on.wait()
        raise ConfigError("seed: refused")

    drawing = Drawing(RenderSettings((64, 64)))
    drawing.draw("a", blocked)
    started.wait()
    waiting = drawing.draw("a", lambda: Wanted(Config.preset()))
    threading.Timer(0.1, go_on.set).start()
    drawing.close()
    with pytest.raises(Superseded):
        waiting.result(timeout=10)


# ---- the command


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_server_cleanly_even_while_it_draws(number):
    words = [sys.executable, "-m", "fastgen", "studio", "--no-browser", "--size", "64x64"]
    pipe = subprocess.PIPE
    with interruptible(words, stdout=pipe, stderr=pipe) as server:
        address = re.search(r"http://\S+/", server.stdout.readline())[0]
        connection = http.client.HTTPConnection(address.split("/")[2])
        # the first image takes seconds, so the signal comes while it is drawn
        connection.request("POST", f"{urlsplit(address).path}draw", json.dumps(WANTED))
        urllib.request.urlopen(f"{address}controls").close()  # the server has the first request
        server.send_signal(number)
        assert connection.getresponse().status in (200, 503)
        connection.close()
        _, errors = server.communicate(timeout=60)
    assert errors == "fastgen: stopped\n"
    assert server.returncode == 128 + number


def test_a_busy_port_is_refused_in_one_line(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["studio", "--no-browser", "--port", str(port)]) == 2
        with pytest.raises(OutputError, match=f"port: {port} cannot be used"):
            listening(port)
    words = capsys.readouterr().err
    assert words.startswith(f"fastgen: port: {port} cannot be used (address already in use)")
    assert words.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--port", "70000"), "port: 70000"),
        (("--preset", "harbour"), "preset: 'harbour'"),
        (("--config", "/nowhere.yaml"), "/nowhere.yaml: cannot be read"),
        (("--seed", "-1"), "seed: -1"),
        (("--size", "3x3"), "size: 3x3"),
        (("--backend", "metal"), "backend: 'metal'"),
    ],
)
def test_bad_options_are_refused_before_anything_is_served(capsys, options, words):
    assert main(["studio", "--no-browser", *options]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith(f"fastgen: {words}")
    assert not printed.out


def test_without_the_extra_the_command_says_what_to_install():
    code = (
        "import sys; sys.modules['uvicorn'] = None\n"
        "from fastgen.cli.main import main; sys.exit(main(['studio', '--no-browser']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "fastgen: studio needs Starlette and uvicorn; run pip install 'fastgen[studio]'\n"
    )
