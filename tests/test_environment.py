"""Environments: HDRI files, the disk cache, metering and the bundled HDRIs."""

import json
import os
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest

from fastgen import Config
from fastgen.errors import AssetError
from fastgen.light import environment
from fastgen.light.environment import (
    EnvironmentLight,
    irradiance_at,
    load_environment,
    metered_luminance,
    prefilter_environment,
)
from fastgen.light.hdri import bundled_hdris, bundled_weights, find_hdris, load_radiance
from fastgen.sampling.scene import sample_scene
from tests.sky_samples import patchwork, texel_grid


def write_exr(path: Path, image: np.ndarray, name: str = "RGB") -> Path:
    return write_channels(path, {name: image})


def write_channels(path: Path, channels: dict[str, np.ndarray]) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))
    return path


def write_flat_hdr(path: Path, rgbe: np.ndarray) -> Path:
    """Write RGBE pixels [H, W, 4] as a Radiance file without run-length encoding."""
    height, width = rgbe.shape[:2]
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    path.write_bytes(head.encode() + rgbe.astype(np.uint8).tobytes())
    return path


def test_unusable_values_are_replaced_on_reading(tmp_path):
    image = np.full((128, 256, 3), 0.25, np.float32)
    image[10, 20] = np.inf
    image[11, 30] = -5.0
    image[12, 0, 1] = np.nan
    image[60:63, 100:103] = np.nan
    image[80, 80] = -np.inf
    read = load_radiance(write_exr(tmp_path / "odd.exr", image))
    assert np.isfinite(read).all()
    assert (read[10, 20] == 65504).all()
    assert (read[11, 30] == 0).all()
    assert (read[80, 80] == 0).all()
    np.testing.assert_allclose(read[12, 0], 0.25)  # from its neighbours, also across the seam
    np.testing.assert_allclose(read[60, 100], 0.25)
    assert (read[61, 101] == 0).all()  # no valid neighbours
    light = prefilter_environment("odd", read)
    assert np.isfinite(light.specular).all()


def test_black_environment_is_black_and_metered_above_zero():
    light = prefilter_environment("black", np.zeros((128, 256, 3), np.float32))
    assert not light.specular.any()
    assert not light.irradiance.any()
    assert metered_luminance(light, np.array([1.0, 0, 0]), 30.0, 0.0) > 0


def test_meter_reads_the_side_it_points_at_and_follows_yaw():
    direction, _ = texel_grid(128)
    image = np.where(direction[..., :1] > 0.5, 8.0, 0.5).astype(np.float32)  # bright toward +x
    light = prefilter_environment("side", np.repeat(image, 3, axis=2))
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert metered_luminance(light, x, 20.0, 0.0) == pytest.approx(8, rel=0.01)
    assert metered_luminance(light, y, 20.0, 0.0) == pytest.approx(0.5, rel=0.01)
    # a quarter turn counter-clockwise moves the light from +x to +y
    assert metered_luminance(light, y, 20.0, 90.0) == pytest.approx(8, rel=0.01)
    assert metered_luminance(light, x, 20.0, 90.0) == pytest.approx(0.5, rel=0.01)
    # a cap of 60 degrees around the normal gives sin^2(60) of a full hemisphere's irradiance
    falling = irradiance_at(light, y[None], 90.0)[0, 0]
    assert falling == pytest.approx(0.5 + 7.5 * 0.75, rel=0.01)
    # |x| > 0.5 is half of the hemisphere; the tolerance is for cells, which are averages
    assert metered_luminance(light, x, 90.0, 0.0) == pytest.approx(2, rel=0.15)


def test_mean_luminance_equals_the_mean_over_the_sphere():
    radiance = patchwork(3)
    light = prefilter_environment("patches", radiance)
    _, solid_angle = texel_grid(radiance.shape[0])
    luminance = radiance @ np.array([0.2126, 0.7152, 0.0722])
    expected = (luminance * solid_angle).sum() / (4 * np.pi)
    assert light.mean_luminance == pytest.approx(expected, rel=1e-3)


def test_cached_environment_is_identical_and_needs_no_second_prefilter(tmp_path, monkeypatch):
    path = write_exr(tmp_path / "a.exr", patchwork(1))
    first = load_environment(path, tmp_path / "cache")

    def never(*_: object) -> None:
        raise AssertionError("prefiltered again")

    monkeypatch.setattr(environment, "prefilter_environment", never)
    renamed = path.rename(tmp_path / "b.exr")
    second = load_environment(renamed, tmp_path / "cache")
    assert (first.name, second.name) == ("a", "b")
    for field in ("specular", "irradiance", "background", "luminance"):
        np.testing.assert_array_equal(getattr(first, field), getattr(second, field))
    assert first.mean_luminance == second.mean_luminance
    write_exr(renamed, patchwork(2))
    with pytest.raises(AssertionError, match="again"):
        load_environment(renamed, tmp_path / "cache")


def test_broken_cache_entry_is_built_again(tmp_path):
    path = write_exr(tmp_path / "a.exr", patchwork(1))
    first = load_environment(path, tmp_path / "cache")
    (entry,) = (tmp_path / "cache").iterdir()
    data = entry.read_bytes()
    entry.unlink()  # mapped pages must not change
    entry.write_bytes(data[: len(data) // 2])
    again = load_environment(path, tmp_path / "cache")
    np.testing.assert_array_equal(first.specular, again.specular)
    np.testing.assert_array_equal(first.irradiance, again.irradiance)
    assert entry.read_bytes() == data


def test_racing_writers_leave_one_whole_entry(tmp_path):
    path = write_exr(tmp_path / "a.exr", patchwork(1))
    start = threading.Barrier(3)
    found: list[EnvironmentLight] = []

    def work() -> None:
        start.wait()
        found.append(load_environment(path, tmp_path / "cache"))

    workers = [threading.Thread(target=work) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(found) == 3
    assert len(list((tmp_path / "cache").iterdir())) == 1
    for light in found:
        np.testing.assert_array_equal(light.specular, found[0].specular)


def test_only_one_of_several_workers_prefilters_an_environment(tmp_path):
    path = write_exr(tmp_path / "a.exr", patchwork(1))
    code = """if True:
        import sys, time
        from fastgen.light import environment
        made = environment.prefilter_environment
        def slowly(*of):
            print("prefilters", flush=True)
            time.sleep(1)
            return made(*of)
        environment.prefilter_environment = slowly
        print("ready", flush=True)
        sys.stdin.readline()
        environment.load_environment(sys.argv[1], sys.argv[2])
    """
    command = [sys.executable, "-c", code, str(path), str(tmp_path / "cache")]
    pipe = subprocess.PIPE
    workers = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for _ in range(3)]
    assert [worker.stdout.readline() for worker in workers] == 3 * ["ready\n"]
    for worker in workers:
        worker.stdin.write("go\n")
        worker.stdin.flush()
    said = [worker.communicate(timeout=120)[0] for worker in workers]
    assert [worker.returncode for worker in workers] == [0, 0, 0]
    assert "".join(said).count("prefilters") == 1
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_an_unwritable_cache_folder_only_disables_caching(tmp_path):
    path = write_exr(tmp_path / "a.exr", patchwork(1))
    (tmp_path / "file").write_text("in the way")
    light = load_environment(path, tmp_path / "file" / "cache")
    assert light.specular.any()


def test_default_cache_follows_xdg(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    load_environment(write_exr(tmp_path / "a.exr", patchwork(1)))
    assert len(list((tmp_path / "xdg" / "fastgen").iterdir())) == 1


def test_hdr_bytes_decode_to_the_correct_radiance(tmp_path):
    rgbe = np.random.default_rng(2).integers(3, 256, (128, 256, 4))
    rgbe[..., 3] = 120 + rgbe[..., 3] % 20
    read = load_radiance(write_flat_hdr(tmp_path / "flat.hdr", rgbe))
    # 8-bit mantissas and an exponent with a bias of 128 (Ward 1991, Real Pixels)
    expected = rgbe[..., :3] * 2.0 ** (rgbe[..., 3:] - 136)
    np.testing.assert_allclose(read, expected, rtol=0.01, atol=2.0**-17)


def test_hdr_and_exr_of_the_same_picture_agree(tmp_path):
    image = patchwork(4)
    exr = load_radiance(write_exr(tmp_path / "a.EXR", image))
    cv2.imwrite(str(tmp_path / "a.hdr"), image[..., ::-1])
    hdr = load_radiance(tmp_path / "a.hdr")
    np.testing.assert_array_equal(exr, image)
    # the exponent is shared: a channel is exact to 1/128 of the brightest one
    assert (np.abs(hdr - exr) <= exr.max(-1, keepdims=True) / 128).all()


@pytest.mark.parametrize("kind", ["grey", "alpha", "half", "layer", "more"])
def test_channel_layouts_are_read_as_rgb(tmp_path, kind):
    image = patchwork(4)
    path = tmp_path / "x.exr"
    if kind == "grey":
        write_exr(path, image[..., 0].copy(), "Y")
        image = np.repeat(image[..., :1], 3, axis=2)
    elif kind == "alpha":
        write_exr(path, np.concatenate([image, np.zeros((128, 256, 1), np.float32)], 2), "RGBA")
    elif kind == "more":  # with other render passes
        planes = {name: image[..., c].copy() for c, name in enumerate("RGB")}
        others = ("A", "roughness", "bump", "glow.")
        write_channels(path, planes | {name: image[..., 0] + 1 for name in others})
    elif kind == "half":
        write_exr(path, image.astype(np.float16))
    else:
        write_exr(path, image, "sky")
    np.testing.assert_allclose(load_radiance(path), image, rtol=1e-3)


def bad_files(folder: Path) -> dict[str, Path]:
    flat = np.ones((128, 256, 3), np.float32)
    whole = write_exr(folder / "whole.exr", patchwork(4)).read_bytes()
    paths = {
        "text.exr": b"not a picture",
        "text.hdr": b"not a picture",
        "empty.exr": b"",
        "empty.hdr": b"",
        "cut.exr": whole[: len(whole) // 2],
        "cut.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 128 +X 256\n\x02\x02\x01",
        "photo.hdr": cv2.imencode(".png", np.zeros((128, 256, 3), np.uint8))[1].tobytes(),
        "wrong.png": b"",
    }
    for name, data in paths.items():
        (folder / name).write_bytes(data)
    write_exr(folder / "small.exr", flat[:64, :128].copy())
    write_exr(folder / "square.exr", np.ones((256, 256, 3), np.float32))
    write_exr(folder / "depth.exr", flat[..., 0].copy(), "Z")
    write_flat_hdr(folder / "small.hdr", np.ones((64, 128, 4)))
    (folder / "folder.exr").mkdir()
    names = [*paths, "small.exr", "square.exr", "depth.exr", "small.hdr", "folder.exr", "none.hdr"]
    return {name: folder / name for name in names}


def test_every_unusable_file_is_refused_by_name(tmp_path):
    for name, path in bad_files(tmp_path).items():
        with pytest.raises(AssetError, match=name) as caught:
            load_environment(path, tmp_path / "cache")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0.0, np.nan, -3.0, 1e-9])
def test_an_hdri_without_light_is_refused_by_name_cached_or_not(tmp_path, value):
    path = write_exr(tmp_path / "night.exr", np.full((128, 256, 3), value, np.float32))
    for _ in range(2):
        with pytest.raises(AssetError, match=r"night\.exr: is dark"):
            load_environment(path, tmp_path / "cache")


@pytest.mark.parametrize("value", [3e4, 1e30])
def test_an_hdri_too_bright_for_half_floats_is_refused_by_name(tmp_path, value):
    path = write_exr(tmp_path / "lamp.exr", np.full((128, 256, 3), value, np.float32))
    with pytest.raises(AssetError, match=r"lamp\.exr: is too bright"):
        load_environment(path, tmp_path / "cache")


def test_a_faint_light_is_accepted(tmp_path):
    image = np.zeros((128, 256, 3), np.float32)
    image[64] = 0.01  # a glow along the horizon
    assert load_environment(write_exr(tmp_path / "dusk.exr", image), tmp_path).mean_luminance > 0


def test_folder_listing_is_sorted_and_ignores_other_files(tmp_path):
    for name in ("b.HDR", "a.exr", "c.Exr", "notes.txt", "d.png", "._a.exr", ".hidden.hdr"):
        (tmp_path / name).touch()
    assert [p.name for p in find_hdris(tmp_path)] == ["a.exr", "b.HDR", "c.Exr"]


def test_a_file_name_that_is_not_utf_8_is_refused(tmp_path):
    (tmp_path / os.fsdecode(b"sk\xff.hdr")).write_bytes(b"")
    with pytest.raises(AssetError, match=r"hdr: name is not valid UTF-8; rename it"):
        find_hdris(tmp_path)


def test_folder_without_hdris_is_refused_by_name(tmp_path):
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(AssetError, match=str(folder)):
            find_hdris(folder)


def test_bundled_environments_are_complete_free_and_varied():
    bundled = bundled_hdris()
    folder = next(iter(bundled.values())).parent
    index = json.loads((folder / "index.json").read_text(encoding="utf-8"))
    assert {p.name for p in find_hdris(folder)} == {p.name for p in bundled.values()}
    assert len(bundled) >= 16
    sources = (folder / "SOURCES.md").read_text(encoding="utf-8")
    for name, path in bundled.items():
        radiance = load_radiance(path)
        assert radiance.shape[1] == 2 * radiance.shape[0]
        assert 0 < radiance.mean() < radiance.max() <= 65504
        ours = name.startswith("port_")
        assert index[name]["licence"] == ("Apache-2.0" if ours else "CC0-1.0")
        assert f"| {path.name} |" in sources
    kinds = {kind for entry in index.values() for kind in entry["kind"]}
    assert {"day", "night", "dusk", "overcast", "urban", "industrial", "port"} <= kinds


def test_ports_weigh_more_than_other_places_and_special_ones_nothing():
    folder = next(iter(bundled_hdris().values())).parent
    index = json.loads((folder / "index.json").read_text(encoding="utf-8"))
    weights = bundled_weights()
    assert list(weights) == list(bundled_hdris())
    for name, weight in weights.items():
        kind = set(index[name]["kind"])
        special = bool(kind & {"interior", "gate", "aisle", "rail"})
        assert (weight == 0) == special
        assert (weight > 1) == ("port" in kind and not special)


def test_scenes_follow_the_weights_unless_environments_are_named():
    def drawn(config, weights):
        scenes = [sample_scene(config, 5, i, weights) for i in range(12)]
        return Counter(scene.environment.name for scene in scenes)

    assert drawn(Config.preset(), {"quay": 1.0, "hall": 0.0}) == {"quay": 12}
    often = drawn(Config.preset(), {"rare": 0.01, "often": 0.99})
    assert often["often"] > 9
    named = Config.from_values({"environment": {"names": ["hall"]}})
    assert drawn(named, {"quay": 1.0, "hall": 0.0}) == {"hall": 12}
