"""The Generator class: bad arguments, pickles, forks, threads, interruption and freed memory."""

import contextlib
import math
import multiprocessing
import pickle
import shutil
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import psutil
import pytest

from fastgen.camera.projection import view_of
from fastgen.config.config import Config, LabelConfig
from fastgen.errors import AssetError, ConfigError
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.light.hdri import bundled_hdris
from fastgen.resources import asset_path, shader_path
from fastgen.scene import Camera, Scene
from fastgen.scene.faces import SHEET_FACES
from tests.backends import BACKENDS

SIZE = (96, 64)
RIG = {"gate": {"face": "door", "focal_mm": 40, "distance_mm": 6000}}


def resident_mib():
    """Return the resident memory of this process in MiB."""
    return psutil.Process().memory_info().rss / 2**20


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"config": {}}, "config: dict is not a Config"),
        ({"config": Config(labels=LabelConfig(min_visible_px=math.nan))}, "labels.min_visible_px"),  # type: ignore[arg-type]
        ({"config": Config(labels=None)}, "labels: expected a mapping"),  # type: ignore[arg-type]
        ({"seed": "x"}, "seed: 'x' is not a whole number of 0 or more"),
        ({"seed": True}, "seed: True is not"),
        ({"seed": 2**64}, "seed: 18446744073709551616 is not a whole number of 0 to"),
        ({"size": 640}, r"size: 640 is not a pair; give \(width, height\)"),
        ({"size": (32, 640)}, "size: 32x640 is out of range"),
        ({"size": (64.5, 64)}, "size: 64.5x64 is out of range; each side takes .* whole pixels"),
        ({"size": ("a", 1)}, "size: ax1 is out of range"),
        ({"size": (math.nan, 64)}, "size: nanx64 is out of range"),
        ({"quality": 3}, "quality: 3 is unknown"),
        ({"quality": []}, r"quality: \[\] is unknown"),
        ({"quality": np.array(["high", "high"])}, r"quality: array.* is unknown"),
        ({"backend": "elg"}, r"backend: 'elg' is unknown \(did you mean egl"),
        ({"hdri_dir": 3}, "hdri_dir: 3 is not a path"),
        ({"device_index": -1}, "device_index: -1 is not"),
    ],
)
def test_bad_arguments_are_named(arguments, words):
    with pytest.raises(ConfigError, match=words):
        Generator(**arguments)


@pytest.fixture(scope="module")
def generator():
    with Generator(seed=3, size=SIZE) as made:
        yield made


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "give either index or scene"),
        ({"index": 1.5}, "index: 1.5 is not a whole number"),
        ({"index": "1"}, "index: '1' is not"),
        ({"index": 0, "camera": 3}, "camera: 3 is neither a Camera nor the name of one"),
        ({"index": 0, "camera": "D"}, "camera: 'D' is unknown"),
        ({"index": 0, "layer": "rusty"}, r"layer: 'rusty' is unknown \(did you mean rust"),
        ({"index": 0, "layer": None}, "layer: None is unknown"),
        (
            {"index": 0, "camera": Camera("c", (0, 9, 0), (0, 9, 0), 20)},
            "camera.target_mm: .* own position",
        ),
        ({"index": 0, "camera": Camera("c", (0, 9, 0), (0, 0, 0), 0)}, "camera.focal_mm: 0 is out"),
        (
            {"index": 0, "camera": Camera("c", (0, 9, 0), (0, 0, 0), "x")},  # type: ignore[arg-type]
            "camera.focal_mm: expected a number, got 'x'",
        ),
        ({"scene": {}}, "scene: dict is not a Scene"),
    ],
)
def test_bad_arguments_of_a_render_are_named(generator, arguments, words):
    with pytest.raises(ConfigError, match=words):
        generator.render(**arguments)


@pytest.mark.parametrize(
    ("part", "changes", "words"),
    [
        ("decals", {"face": "lid"}, r"decals\[0\].face: 'lid' is unknown"),
        ("decals", {"class_name": "C10"}, r"decals\[0\].class_name: 'C10' is unknown"),
        ("decals", {"kind": "text", "font": "comic"}, r"decals\[0\].font: 'comic' is unknown"),
        ("decals", {"kind": "marker", "art": "C1.9"}, r"decals\[0\].art: 'C1.9' is unknown"),
        ("decals", {"size_mm": (0.0, 5.0)}, r"decals\[0\].size_mm\[0\]: 0.0 is out of range"),
        (
            "decals",
            {"center_mm": (0.0, math.inf)},
            r"decals\[0\].center_mm\[1\]: inf is out of range",
        ),
        ("damages", {"kind": "dent"}, r"damages\[0\].kind: 'dent' is unknown"),
        (
            "damages",
            {"form": "plain", "shape": (1.0,)},
            r"damages\[0\].shape: 1 number, but kind concave, form plain has none",
        ),
        ("damages", {"size_mm": (9.0, -1.0)}, r"damages\[0\].size_mm\[1\]: -1.0 is out of range"),
        ("damages", {"along": (0.0, 0.0, 0.0)}, r"damages\[0\].along, across, inward: these"),
        ("container", {"kind": "30"}, "container.kind: '30' is unknown"),
    ],
)
def test_errors_in_scenes_changed_by_hand_name_the_invalid_part(generators, part, changes, words):
    values = {"damage": {"probability": 1, "kinds": ["concave"]}}
    generator = generators(Config.from_values(values), size=SIZE)
    scene = generator.scene(0)
    held = getattr(scene, part)
    one = replace(held[0] if isinstance(held, tuple) else held, **changes)
    bad = replace(scene, **{part: (one,) if isinstance(held, tuple) else one})
    with pytest.raises(ConfigError, match=f"scene.{words}"):
        generator.render(scene=bad)


def test_a_hundred_damages_of_one_kind_are_refused():
    values = {"damage": {"probability": 1, "kinds": ["axis"], "count": [1, 1]}}
    generator = Generator(Config.from_values(values), size=SIZE)
    scene = generator.scene(0)
    with pytest.raises(ConfigError, match="100 of kind axis; mask values distinguish only 99"):
        generator.render(scene=replace(scene, damages=scene.damages * 100))


def test_scene_files_with_nan_are_refused(generator):
    text = generator.scene(0).to_json().replace('"focal_mm": 14.5', '"focal_mm": NaN')
    with pytest.raises(ConfigError, match=r"scene.cameras\[0\].focal_mm: nan is out of range"):
        Scene.from_json(text)


def test_the_first_camera_of_a_rig_is_the_default(generators, generator):
    assert generator.render(index=1).camera.name == "A"
    gate = generators(Config.from_values({"cameras": RIG}), size=SIZE)
    assert gate.render(index=1).camera.name == "gate"


def test_label_rules_may_be_given_for_one_image(generator):
    strict = LabelConfig(min_visible_px=10**6)
    assert all(thing.ignored for thing in generator.render(index=1, labels=strict).objects)
    assert not all(thing.ignored for thing in generator.render(index=1).objects)


def test_hdris_with_the_same_name_are_refused(tmp_path):
    for name in ("dusk.exr", "dusk.hdr"):
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(AssetError, match=r"dusk.exr and dusk.hdr are both called 'dusk'"):
        Generator(hdri_dir=tmp_path)


def test_a_user_hdri_with_the_name_of_a_bundled_one_is_refused(tmp_path):
    bundled = bundled_hdris()
    shutil.copy(bundled["sky"], tmp_path / "night.exr")
    with pytest.raises(
        AssetError, match=r"night\.exr: has the name of a bundled HDRI .*rename the file"
    ):
        Generator(hdri_dir=tmp_path)
    shutil.copy(bundled["night"], tmp_path / "night.exr")
    with Generator(hdri_dir=tmp_path, size=(64, 64), quality="draft") as made:
        assert made.scene(0).environment.name == "night"


def test_a_pickled_generator_renders_the_same(generator):
    image = generator.render(index=2).image
    with pickle.loads(pickle.dumps(generator)) as other:
        np.testing.assert_array_equal(other.render(index=2).image, image)
    np.testing.assert_array_equal(generator.render(index=2).image, image)


def render_to(pipe, generator):
    pipe.send(generator.render(index=2).image)
    generator.close()


def parent_and_child():
    """Return an image rendered here, by the same generator in a fork, and again here."""
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()
    with Generator(seed=3, size=SIZE, backend="auto") as generator:
        before = generator.render(index=2).image
        child = fork.Process(target=render_to, args=(theirs, generator))
        child.start()
        there = ours.recv() if ours.poll(60) else None
        child.kill()
        child.join()
        return before, there, generator.render(index=2).image


def test_a_generator_that_rendered_still_works_in_a_forked_child():
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        before, there, after = pool.submit(parent_and_child).result()
    assert there is not None, "the child hangs or failed"
    np.testing.assert_array_equal(there, before)
    np.testing.assert_array_equal(after, before)


def test_after_preload_no_scene_builds_a_shape_or_loads_a_light(monkeypatch):
    config = Config.from_values(
        {"container": {"kinds": {"20": 1}}, "environment": {"names": ["park", "venice"]}}
    )
    with Generator(config, seed=4, size=SIZE) as generator:
        steps = []
        generator.preload(lambda: steps.append(1))
        assert len(steps) > 10  # lights, shapes and shader variants each report progress

        def never(*_: object, **__: object) -> None:
            raise AssertionError("made after preload")

        for made in ("shapes.GpuMesh", "shapes.zone_table", "scene_lights.GpuLight"):
            monkeypatch.setattr(f"fastgen.render.{made}", never)
        monkeypatch.setattr("fastgen.render.sky_visibility_probe.encoded_cones", never)
        monkeypatch.setattr("fastgen.files.disk_cache.cached", never)
        for index in range(30):
            sample = generator.render(index)
            container = sample.scene.container
            for face in SHEET_FACES:
                mesh = SHAPES.container(container.kind, container.profiles)
                mesh.sheet_to_surface(face, [[0, 0]])


def test_a_sample_prints_in_one_line(generator):
    sample = generator.render(index=3, camera="Cr")
    words = repr(sample)
    assert "index 3" in words
    assert "'Cr'" in words
    assert len(words) < 120


def test_closing_one_generator_does_not_affect_another(generators):
    kept = generators(seed=2, size=SIZE)
    before = kept.render(index=0)
    with Generator(seed=1, size=SIZE) as other:
        other.render(index=0)
        kept.render(index=0)  # so that `other` is not current when it is closed
    after = kept.render(index=0)
    np.testing.assert_array_equal(after.image, before.image)
    np.testing.assert_array_equal(after.ids, before.ids)
    assert after.objects == before.objects


def test_a_generator_can_be_used_by_one_thread_after_another():
    """EGL denies a thread the context that is current in another, even if that one has ended."""
    with Generator(size=SIZE) as other, Generator(size=SIZE) as handed:
        expected = other.render(index=0).image
        for _ in range(3):
            with ThreadPoolExecutor(1) as pool:
                there = pool.submit(handed.render, 0).result().image
            np.testing.assert_array_equal(there, expected)
            np.testing.assert_array_equal(handed.render(index=0).image, expected)


@pytest.mark.parametrize("backend", BACKENDS)
def test_threads_that_share_a_generator_render_in_turn(generators, backend):
    shared = generators(size=SIZE, backend=backend, quality="draft")
    expected = [shared.render(index=index).image for index in range(4)]
    with ThreadPoolExecutor(3) as pool:
        found = pool.map(lambda k: shared.render(index=k % 4).image, range(12))
    for k, image in enumerate(found):
        np.testing.assert_array_equal(image, expected[k % 4])


def drawn_in_a_thread():
    held = Generator(size=(256, 256))
    with ThreadPoolExecutor(1) as pool:
        pool.submit(held.render, 0).result()
    held.close()


def dropped_unclosed():
    Generator(seed=1, size=SIZE, quality="draft").render(index=0)


def growth_mib(use, count):
    """Return the memory growth in MiB over `count` calls of `use` after a first call.

    Also returns two images, before and after, of a generator that stays open throughout.
    """
    with Generator(seed=2, size=SIZE, quality="draft") as kept:
        before = kept.render(index=0).image
        use()
        start = resident_mib()
        for _ in range(count):
            use()
        return resident_mib() - start, before, kept.render(index=0).image


@pytest.mark.parametrize(("use", "count"), [(drawn_in_a_thread, 4), (dropped_unclosed, 6)])
def test_the_memory_of_generators_is_freed(use, count):
    """Use a fresh process, because this one may still free or reuse memory of earlier tests."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        grown, before, after = pool.submit(growth_mib, use, count).result()
    assert grown < 200  # MiB; each generator used 130
    np.testing.assert_array_equal(after, before)


def test_cameras_above_and_below_show_the_length_across_the_image_well_exposed(generators):
    rig = {"focal_mm": 20, "distance_mm": 9000, "roll_deg": 0}
    plumb = {"azimuth_deg": 0, "elevation_deg": 0, "target_shift_mm": 0}
    cameras = {
        "top": {"face": "roof", **rig},
        "plumb": {"face": "roof", **rig, **plumb},
        "pit": {"face": "underside", **rig},
    }
    generator = generators(Config.from_values({"cameras": cameras}), seed=1, size=SIZE)
    for index in range(3):
        scene = generator.scene(index)
        for camera in scene.cameras:
            across, down, _ = view_of(camera, SIZE).rotation @ [1.0, 0.0, 0.0]
            assert across > 0.9
            assert abs(down) < 0.01
        plumb = scene.camera("plumb")
        x, y, z = plumb.position_mm
        beside = replace(plumb, position_mm=(x + 30, y - 20, z))
        exposures = [generator.exposure(scene, camera) for camera in (plumb, beside)]
        assert exposures[0] == pytest.approx(exposures[1], rel=0.02)
        assert generator.render(scene=scene, camera="plumb").image.mean() > 25


def test_an_interrupted_render_does_not_affect_later_ones(monkeypatch):
    """Interrupt between two draw calls, as a notebook's stop button may do."""
    arguments = {"seed": 7, "size": (96, 64)}
    with Generator(**arguments) as generator:
        wanted = generator.render(index=0, camera="Cr")
    calls, stop_at = 0, 0
    real = {kind: kind.render for kind in (moderngl.VertexArray,)}
    real[moderngl.ComputeShader] = moderngl.ComputeShader.run

    def counted(kind):
        def call(self, *given, **named):
            nonlocal calls
            calls += 1
            if calls == stop_at:
                raise KeyboardInterrupt
            return real[kind](self, *given, **named)

        return call

    monkeypatch.setattr(moderngl.VertexArray, "render", counted(moderngl.VertexArray))
    monkeypatch.setattr(moderngl.ComputeShader, "run", counted(moderngl.ComputeShader))
    stopped = 0
    for stop_at in (2, 8):
        with Generator(**arguments) as generator:
            calls = 0
            with contextlib.suppress(KeyboardInterrupt):
                generator.render(index=1, camera="A")
            stopped += calls == stop_at
            calls = stop_at
            sample = generator.render(index=0, camera="Cr")
        np.testing.assert_array_equal(sample.image, wanted.image)
        np.testing.assert_array_equal(sample.ids, wanted.ids)
        assert sample.objects == wanted.objects
    assert stopped == 2


def test_later_generators_read_no_shader_or_artwork_again(monkeypatch):
    """Examples and tests open many generators in one process."""
    read, usual = [], Path.open

    def recorded(path, *arguments, **settings):
        read.append(path)
        return usual(path, *arguments, **settings)

    monkeypatch.setattr(Path, "open", recorded)
    for _ in range(2):
        read.clear()
        with Generator(seed=5, size=(64, 64), quality="draft") as generator:
            generator.render(0, "A")
    folders = (shader_path(), asset_path("markers"), asset_path("stickers"), asset_path("fonts"))
    assert not [path for path in read if any(map(path.is_relative_to, folders))]
