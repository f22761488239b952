"""Scene checks: errors name the invalid field, and sampled scenes pass."""

import dataclasses
import math
from collections import Counter
from dataclasses import replace
from fractions import Fraction

import numpy as np
import orjson
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.errors import ConfigError
from fastgen.geometry.damage_law import amount_mm, in_hole
from fastgen.render.decal_tables import SceneError
from fastgen.scene import Camera, Scene
from fastgen.scene.check import check_camera, check_scene
from fastgen.scene.optics import Defocus, Lens, Noise, Rain, Sensor, Stamp, Weather
from tests.random_damages import FORMS

SIZE = (64, 64)


@pytest.fixture(scope="module")
def full():
    """A scene that uses every optional part."""
    values = {
        "damage": {"probability": 1, "count": [8, 8]},
        "placement": {"arrangements": {"trailer": 1}, "neighbours": 1},
    }
    scene = Generator(Config.from_values(values), seed=2, size=SIZE).scene(3)
    assert scene.neighbours
    assert {damage.kind for damage in scene.damages} >= {"dented", "perforation"}
    sensor = Sensor(
        defocus=Defocus(1500, 1.4), noise=Noise(4000, 4, 3), stamp=Stamp("now", "top left", 0.05)
    )
    camera = replace(scene.cameras[0], lens=Lens("fisheye", (-0.02, 0.0, 0.0, 0.0)), sensor=sensor)
    weather = Weather(80e3, Rain(30, 0.002, 0.1, 5), 0.5)
    return replace(scene, cameras=(camera,), weather=weather)


def leaves(part, path=()):
    """Yield the path of each scalar below `part`; of tuples only the first and last item."""
    if dataclasses.is_dataclass(part):
        for field in dataclasses.fields(part):
            yield from leaves(getattr(part, field.name), (*path, field.name))
    elif isinstance(part, tuple):
        for i in sorted({0, len(part) - 1} if part else set()):
            yield from leaves(part[i], (*path, i))
    elif part is not None:
        yield path


def spoilt(part, path, value):
    """Return `part` with `value` at `path`, without running any constructor."""
    if not path:
        return value
    if isinstance(part, tuple):
        changed = spoilt(part[path[0]], path[1:], value)
        return (*part[: path[0]], changed, *part[path[0] + 1 :])
    copy = object.__new__(type(part))
    copy.__dict__.update(part.__dict__)
    copy.__dict__[path[0]] = spoilt(getattr(part, path[0]), path[1:], value)
    return copy


def held(part, path):
    for step in path:
        part = part[step] if isinstance(step, int) else getattr(part, step)
    return part


def name(path):
    return "scene" + "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in path)


def test_sampled_scenes_pass():
    extreme = {
        "surface": {"rust_coverage": 1.0, "dirt_reach_mm": 1e6, "wear_scale_mm": 1e5},
        "sensor": {"defocus": {"probability": 1, "focus": 100.0}, "vignetting": 0.95},
        "weather": {"rain_probability": 1, "shutter_s": 1e-5, "rate_mm_h": 300},
        "spreader": {"probability": 1, "gap_mm": 200},
    }
    for config in (Config.preset(), Config.preset("crane"), Config.from_values(extreme)):
        generator = Generator(config, seed=5, size=SIZE)
        for index in range(20):
            scene = generator.scene(index)
            assert check_scene(scene) == scene
            assert check_scene(Scene.from_json(scene.to_json())) == scene


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e12, "x", None, True, [1.0], (1.0,)])
def test_every_invalid_leaf_is_named(full, value):
    check_scene(full)
    paths = list(leaves(full))
    assert len(paths) > 100
    for path in paths:
        if type(value) is type(held(full, path)) and isinstance(value, str | bool):
            continue
        with pytest.raises(ConfigError) as caught:
            check_scene(spoilt(full, path, value))
        assert str(caught.value).startswith(f"{name(path)}: "), path


class Text(str):
    """Text of another class than str."""


KINDS = (
    *("bool_", "int64", "int16", "uint64", "float64", "longdouble", "float32", "float16"),
    *("array", "Fraction", "str_", "Text"),
)


def foreign(value):
    """Return equal values of other types, by their name in KINDS."""
    if isinstance(value, bool):
        return {"bool_": np.bool_(value)}
    if isinstance(value, int):
        return {kind.__name__: kind(value) for kind in (np.int64, np.int16, np.uint64)}
    if isinstance(value, float):
        small = [np.float32] + [np.float16] * (abs(value) < 60_000)
        exact = [kind for kind in small if float(kind(value)) == value]
        made = {kind.__name__: kind(value) for kind in (np.float64, np.longdouble, *exact)}
        return made | {"array": np.array(value), "Fraction": Fraction(value)}
    return {"str_": np.str_(value), "Text": Text(value)}


def types_in(part):
    """Return the types of all scalars in the plain form of a scene."""
    return {type(held(part, path)) for path in leaves(part)}


def test_numbers_of_other_types_are_drawn_and_written_as_pythons(full):
    """A scene is changed with NumPy's numbers, for example from an optimizer or a data frame."""
    plain, paths = orjson.dumps(check_scene(full)), list(leaves(full))
    changed, count = dict.fromkeys(KINDS, full), Counter()
    for path in paths:
        for kind, value in foreign(held(full, path)).items():
            changed[kind] = spoilt(changed[kind], path, value)
            count[kind] += 1
    assert min(count[kind] for kind in KINDS) > 0
    for kind, scene in changed.items():
        drawn = check_scene(scene)
        assert drawn == full, kind
        assert types_in(drawn) <= {int, float, str, bool}, kind
        assert orjson.dumps(drawn) == plain  # as in the files of a dataset
        assert Scene.from_json(scene.to_json()) == full, kind


def test_a_camera_with_numpy_numbers_is_drawn_as_one_with_pythons(full):
    given = replace(full.cameras[0], position_mm=tuple(np.float32([0, -9000, 1000])))
    assert {type(value) for value in check_camera(given, full).position_mm} == {float}


@pytest.mark.parametrize(
    "value", [object(), b"x", {1}, np.zeros(2), 10**5000], ids=lambda value: type(value).__name__
)
def test_a_scene_with_unusable_values_is_not_written(full, value):
    for path in (("seed",), ("environment", "yaw_deg"), ("decals", 0, "kind")):
        with pytest.raises(ConfigError) as caught:
            spoilt(full, path, value).to_json()
        assert str(caught.value).startswith(f"{name(path)}: ")
        assert len(str(caught.value)) < 200


def test_every_missing_or_foreign_part_is_named(full):
    for field in dataclasses.fields(full):
        for value in (None, "ABCD", list(full.decals), full.surface.paint, 1.5):
            if (field.name, value) == ("ground", None):
                continue
            with pytest.raises(ConfigError, match=f"^scene.{field.name}"):
                check_scene(spoilt(full, (field.name,), value))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("surface", "paint", "albedo", 1), 1.2),
        (("surface", "paint", "roughness"), -0.1),
        (("surface", "rust", "scale_mm"), 0.0),
        (("surface", "paint", "albedo"), (0.5, 0.5)),
        (("decals", 0, "lines"), "ABCD"),
        (("decals", 0, "wear"), 2.0),
        (("damages", 0, "along"), (1.0, 0.0)),
        (("cameras", 0, "sensor", "jpeg_quality"), 101),
        (("cameras", 0, "sensor", "jpeg_quality"), 50.5),
        (("cameras", 0, "sensor", "vignetting"), 1.0),
        (("cameras", 0, "sensor", "stamp", "corner"), "middle"),
        (("cameras", 0, "sensor", "defocus", "f_number"), 0),
        (("cameras", 0, "exposure_ev"), 200.0),
        (("weather", "wetness"), 1.5),
        (("weather", "visibility_mm"), -1.0),
        (("weather", "rain", "shutter_s"), 0.0),
        (("spreader", "gap_mm"), -5.0),
        (("props", 0, "size_mm"), [100.0, 100.0, 100.0]),  # a list has no hash, see prop_box
        (("props", 0, "pose", "position_mm"), [0.0, 0.0, -500.0]),
        (("index",), -1),
        (("seed",), 2**64),
    ],
)
def test_out_of_range_values_are_named(full, path, value):
    with pytest.raises(ConfigError) as caught:
        check_scene(spoilt(full, path, value))
    assert str(caught.value).startswith(f"{name(path)}: ")


SHAPES = {name: form.parameters for name, form in FORMS.items()}


def shaped(full, kind, form, shape):
    """Return the scene with one damage of a form."""
    place = next(damage for damage in full.damages if damage.kind != "axis")
    return replace(full, damages=(replace(place, kind=kind, form=form, shape=tuple(shape)),))


@pytest.mark.parametrize(("kind", "form"), SHAPES)
def test_every_number_of_a_damage_is_checked(full, kind, form):
    middle = [0.5 * (each.low + min(each.high, 100.0)) for each in SHAPES[kind, form]]
    check_scene(shaped(full, kind, form, middle))
    with pytest.raises(ConfigError, match=r"^scene.damages\[0\].shape: ") as caught:
        check_scene(shaped(full, kind, form, [*middle, 1.0]))
    given = "1 number, but" if not middle else f"{len(middle) + 1} numbers, but"
    assert f"{given} kind {kind}, form {form} has " in str(caught.value)
    # the error lists what the numbers are
    assert all(parameter.name in str(caught.value) for parameter in SHAPES[kind, form])
    for i, each in enumerate(SHAPES[kind, form]):
        for value in (each.low - 1e-3, each.high * 1.01 + 1e-3, math.nan):
            with pytest.raises(ConfigError, match=rf"^scene.damages\[0\].shape\[{i}\][: ]"):
                check_scene(shaped(full, kind, form, [*middle[:i], value, *middle[i + 1 :]]))


@pytest.mark.parametrize(("kind", "form"), SHAPES)
def test_fields_are_finite_at_the_bounds_of_each_number(full, kind, form):
    middle = [0.5 * (each.low + min(each.high, 100.0)) for each in SHAPES[kind, form]]
    (damage,) = shaped(full, kind, form, middle).damages
    points = np.array(damage.origin_mm) + np.random.default_rng(0).uniform(-300, 300, (500, 3))
    points = np.concatenate([points, [damage.origin_mm]])
    for i, each in enumerate(SHAPES[kind, form]):
        for value in (each.low, each.high):
            other = replace(damage, shape=(*middle[:i], value, *middle[i + 1 :]))
            assert np.isfinite(amount_mm(other, points)).all()
            assert np.isfinite(in_hole(other, points)).all()


def test_an_unknown_form_of_damage_is_named(full):
    with pytest.raises(ConfigError, match=r"^scene.damages\[0\].form: .*torn"):
        check_scene(shaped(full, "perforation", "tron", ()))


def test_a_camera_passed_separately_is_checked_too(full):
    camera = Camera("c", (0, -9000, 1000), (0, 0, 1000), 20)
    assert check_camera(camera, full) == camera
    assert view_of(camera, SIZE).size == SIZE
    with pytest.raises(ConfigError, match=r"^camera.lens.coefficients\[0\]: nan is out of range"):
        check_camera(replace(camera, lens=Lens("fisheye", (math.nan, 0, 0, 0))), full)


@pytest.mark.parametrize("inside", [(0, 0, 1300), (2900, -1200, 10)])
def test_a_camera_inside_the_container_is_refused(full, inside):
    full = replace(full, props=())  # vehicle parts are just below the container
    camera = Camera("c", inside, (9000, 0, 1000), 20)
    with pytest.raises(ConfigError, match=r"^camera.position_mm: .* is inside the container"):
        check_camera(camera, full)
    check_camera(replace(camera, position_mm=(inside[0], inside[1], -101)), full)
    for near in (-1, -99):
        with pytest.raises(ConfigError, match=r"^camera.position_mm: .* nearer .* than 100 mm"):
            check_camera(replace(camera, position_mm=(inside[0], inside[1], near)), full)
    with pytest.raises(ConfigError, match=r"^scene.cameras\[0\].position_mm"):
        check_scene(replace(full, cameras=(camera,)))


@pytest.mark.parametrize("labels", ["x", {}, 3])
def test_labels_must_be_a_label_config(labels):
    with (
        Generator(size=SIZE) as generator,
        pytest.raises(ConfigError, match=r"^labels: expected a LabelConfig"),
    ):
        generator.render(index=0, labels=labels)


def test_a_letter_that_the_font_lacks_is_named(full):
    i = next(i for i, decal in enumerate(full.decals) if decal.kind == "text")
    path = ("decals", i, "lines")
    with pytest.raises(ConfigError, match=rf"scene\.decals\[{i}\]\.lines: 'Ü' is unknown"):
        check_scene(spoilt(full, path, ("ÜBER",)))


def test_a_text_with_too_many_letters_is_named(full):
    # identifiers have parts, which must agree with their lines
    i = next(i for i, decal in enumerate(full.decals) if decal.kind == "text" and not decal.parts)
    path = ("decals", i, "lines")
    check_scene(spoilt(full, path, ("A " * 2000, "B" * 2095)))
    with pytest.raises(ConfigError, match=rf"decals\[{i}\]\.lines: 4096 letters; give fewer"):
        check_scene(spoilt(full, path, ("A " * 2000, "B" * 2096)))


def test_a_decal_off_its_sheet_is_named(generators):
    generator = generators(seed=2, size=SIZE)
    scene = generator.scene(3)
    beside = replace(scene.decals[0], center_mm=(90000.0, 300.0))
    scene = replace(scene, decals=(beside,))
    with pytest.raises(SceneError, match=r"decals\[0\].* lies off its sheet"):
        generator.render(scene=scene, camera="A")


def test_a_marker_that_is_not_square_is_refused(full):
    number = next(i for i, decal in enumerate(full.decals) if decal.kind == "marker")
    oblong = replace(full.decals[number], size_mm=(250.0, 500.0))
    decals = (*full.decals[:number], oblong, *full.decals[number + 1 :])
    with pytest.raises(ConfigError, match=rf"^scene.decals\[{number}\].size_mm: .*250 and 500"):
        check_scene(replace(full, decals=decals))


def test_a_camera_too_far_away_is_refused(full):
    near = replace(full.cameras[0], position_mm=(0.0, -170e3, 0.0), lens=None)
    assert check_camera(near, full) == near
    with pytest.raises(ConfigError, match=r"camera.position_mm: .* sight ends at 180 m"):
        check_camera(replace(near, position_mm=(0.0, -300e3, 0.0)), full)


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"scene": ' * 100_000])
def test_text_that_is_no_scene_gets_one_error(text):
    with pytest.raises(ConfigError, match=r"^scene: is no JSON \("):
        Scene.from_json(text)
