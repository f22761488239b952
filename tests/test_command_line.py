"""The command line: errors for bad input, and every layer of `show`."""

import cv2
import numpy as np
import pytest

from fastgen.classes import CONTAINER_ID, SPREADER_ID, UNDAMAGED_CONTAINER
from fastgen.cli.main import _parser, main
from fastgen.overlay import DAMAGE_GREYS, ID_GREYS, label_colors
from fastgen.preview import preview
from fastgen.render.variant import LAYERS


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generate", "{out}", "--images", "0"], "images: 0 is out of range"),
        (["generate", "{out}", "--images", "2", "--size", "10x10"], "size: 10x10 is out of range"),
        (["generate", "{out}", "--images", "2", "--size", "huge"], "size: 'huge' is not a size"),
        (["generate", "{out}", "--images", "2", "--workers", "0"], "workers: 0 is out of range"),
        (["generate", "{out}", "--images", "2", "--preset", "seafornt"], "did you mean seafront"),
        (["generate", "{out}", "--images", "2", "--cameras", "A,D"], "cameras: 'D' is unknown"),
        (["generate", "{out}", "--images", "2", "--format", "voc"], "format: 'voc' is unknown"),
        (["generate", "{out}", "--images", "2", "--also", "vox"], "did you mean voc"),
        (
            ["generate", "{out}", "--images", "2", "--also", "x"],
            "from bop, coco, depth, hub, ids, kitti, nor",
        ),
        (["generate", "{out}", "--images", "2", "--also", "voc,"], "also: '' is unknown"),
        (["generate", "{out}", "--images", "2", "--also", "voc,voc"], "also: a name occurs twice"),
        (["generate", "{out}", "--images", "2", "--hdri", ""], "'': is not a folder"),
        (["generate", "{out}", "--images", "2", "--shard", "0"], "shard: 0 is out of range"),
        (["generate", "{out}", "--images", "2", "--hdri", "{empty}"], "empty"),
        (["generate", "{out}", "--images", "2", "--hdri", "{broken}"], "photo.hdr"),
        (["generate", "{out}", "--images", "2", "--config", "{bad}"], "did you mean rust_coverage"),
        (["generate", "{full}", "--images", "2"], "holds something else"),
        (["generate", "file://{full}/", "--images", "2"], "holds something else"),
        (["generate", "memory:///", "--images", "2"], "memory:///: is memory of this process"),
        (["generate", "{out}", "--images", "2", "--seed", "-1"], "seed: -1"),
        (
            ["generate", "{out}", "--images", "2", "--backend", "osmesa", "--device-index", "0"],
            "device_index: 0: osmesa has no devices",
        ),
        (["show", "--index", "0", "--device-index", "99", "-o", "{out}.png"], "no device 99 among"),
        (
            ["export", "--index", "0", "--device-index", "99", "-o", "{out}.glb"],
            "no device 99 among",
        ),
        (["show", "--index", "0", "--layer", "rusty", "-o", "{out}.png"], "did you mean rust"),
        (["show", "--index", "0", "-o", "{out}.gif"], "ends in .png or .jpg"),
        (["verify", "{empty}"], "no readable dataset.json; give a dataset's folder"),
        (["verify", "{out}"], "no readable dataset.json; give a dataset's folder"),
        (["verify", "{full}/notes.txt"], "no readable dataset.json; give a dataset's folder"),
        (["stats", "{empty}"], "no readable dataset.json"),
    ],
)
def test_bad_input_gets_one_clear_line_and_code_2(arguments, message, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes.txt").write_text("mine")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken/photo.hdr").write_text("no radiance here")
    (tmp_path / "bad.yaml").write_text("surface: {rust_coverag: [0, 1]}\n")
    places = {name: str(tmp_path / name) for name in ("out", "empty", "full", "broken")}
    filled = [a.format(**places, bad=tmp_path / "bad.yaml") for a in arguments]
    assert main(filled) == 2
    error = capsys.readouterr().err
    assert error.startswith("fastgen: ")
    assert error.count("\n") == 1
    assert message in error
    assert not list(tmp_path.glob("out*"))


def test_workers_render_only_on_the_named_device(tmp_path, capsys):
    command = ["generate", str(tmp_path / "out"), "--images", "2", "--size", "64x64"]
    assert main([*command, "--device-index", "99"]) == 2
    assert "there is no device 99 among" in capsys.readouterr().err
    assert main([*command, "--device-index", "0"]) == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["generate", "x", "--images", "many"],
        ["generate", "x"],
        ["show", "--index", "1.5", "-o", "x.png"],
        ["paint"],
    ],
)
def test_a_malformed_command_line_gets_one_clear_line_and_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("fastgen: ")
    assert error.count("\n") == 1


def options_with_values():
    """Yield command and option for each option that takes a value."""
    (subparsers,) = (a for a in _parser()._actions if isinstance(a.choices, dict))
    for command, parser in subparsers.choices.items():
        for action in parser._actions:
            if action.option_strings and action.nargs != 0:
                yield from ((command, option) for option in action.option_strings)


ODD_VALUES = [
    (command, option, value)
    for command, option in options_with_values()
    for value in ("--", "9" * 5000 + "x")
    if value == "--" or option not in ("--ray", "-o", "--camera", "--hdri")  # these take any text
]


@pytest.mark.parametrize(("command", "option", "value"), ODD_VALUES)
def test_odd_values_of_every_option_get_one_clear_line_and_code_2(
    command, option, value, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    required = {"--images": "1", "--index": "0", "-o": "x.zip"}  # and so nothing is rendered
    needed = {"generate": ["--images"], "show": ["--index", "-o"], "export": ["--index", "-o"]}
    given = [f"{name}={required[name]}" for name in needed.get(command, []) if name != option]
    places = [] if command in ("config", "show", "export", "studio") else ["none/there"]
    try:
        code = main([command, *places, *given, f"{option}={value}"])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    error = capsys.readouterr().err
    assert error.startswith("fastgen: ")
    assert error.count("\n") == 1
    assert len(error) < 5000
    assert not list(tmp_path.iterdir())


def test_descriptions_of_commands_keep_the_capitals_of_their_help():
    (subparsers,) = (a for a in _parser()._actions if isinstance(a.choices, dict))
    helps = {each.dest: each.help for each in subparsers._choices_actions}
    described = {name: each.description for name, each in subparsers.choices.items()}
    same = [name for name in helps if described[name].lower() == f"{helps[name].lower()}."]
    assert {"doctor", "report"} <= {*same}
    for name in same:
        assert described[name][1:] == f"{helps[name][1:]}."
        assert described[name][0] == helps[name][0].upper()


def test_the_options_with_values_are_found():
    found = set(options_with_values())
    assert {("generate", "--seed"), ("show", "-o"), ("fit", "--budget")} <= found
    assert len(found) > 40


@pytest.mark.parametrize("failure", [KeyError("a\x1b[31m"), RecursionError(), AssertionError("x")])
def test_a_bug_has_a_code_of_its_own(failure, monkeypatch, capsys):
    """1 stands for faults of a dataset, which a script may want to repair."""

    def fails(_):
        raise failure

    monkeypatch.setattr("fastgen.cli.dataset_commands.examine", fails)
    assert main(["verify", "x"]) == 70
    error = capsys.readouterr().err
    assert "this is a bug in fastgen: please report it" in error.splitlines()[-1]
    assert "Traceback" in error
    assert "\x1b" not in error


def test_running_out_of_memory_is_no_bug(monkeypatch, capsys):
    def fails(_):
        raise MemoryError

    monkeypatch.setattr("fastgen.cli.dataset_commands.examine", fails)
    assert main(["verify", "x"]) == 2
    assert capsys.readouterr().err.startswith("fastgen: out of memory")


def test_show_writes_the_layer_that_it_is_asked_for(tmp_path, generators):
    path, size = tmp_path / "shown.png", (128, 128)
    arguments = ["--index", "1", "--camera", "Cr", "--size", "128x128", "--quality", "draft"]
    arguments += ["--layer", "rust", "--overlay", "-o", str(path)]
    assert main(["show", *arguments]) == 0
    shown = preview(generators(seed=0, size=size, quality="draft"), 1, "Cr", "rust", True)
    np.testing.assert_array_equal(cv2.imread(str(path))[..., ::-1], shown)


def test_every_layer_is_another_picture(generators):
    generator = generators(seed=0, size=(128, 128), quality="draft")
    pictures = [preview(generator, 1, "Cr", layer) for layer in (*LAYERS, "ids", "damage")]
    for picture in pictures:
        assert picture.shape == (128, 128, 3)
        assert np.ptp(picture) > 0
    assert len({picture.tobytes() for picture in pictures}) == len(LAYERS) + 2


@pytest.mark.parametrize(
    ("labels", "greys"),
    [
        ([*range(70), SPREADER_ID], ID_GREYS),
        ([0, 101, *(100 * kind + n for kind in (2, 3, 4, 5) for n in range(1, 10))], DAMAGE_GREYS),
        ([CONTAINER_ID, UNDAMAGED_CONTAINER], ID_GREYS),  # as an id, 101 is a decal
    ],
)
def test_shown_labels_have_clearly_different_colours(labels, greys):
    shown = label_colors(np.array([labels], np.uint16), greys)[0].astype(float)
    apart = np.linalg.norm(shown[:, None] - shown, axis=-1)
    assert apart[~np.eye(len(labels), dtype=bool)].min() > 20
