"""Reference images of the benchmarks, and the figures and charts computed from them."""

import itertools
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import ablation_elements
import cycles_figures
import image_error
import numpy as np
import pareto_chart
import pytest
import reference_set
from reference_set import FILTERS
from surrounded_cases import SurroundedCase, every_case, surrounded_cases

from fastgen import Config, Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader
from fastgen.render.program import shader_text
from fastgen.render.variant import LAYERS
from fastgen.scene.check import check_scene


@pytest.mark.parametrize("count", [8, 16, 24, 32])
def test_each_prefix_of_the_cases_is_balanced_over_light_camera_and_state(count):
    chosen = reference_set.cases()[:count]
    for trait, kinds in (("light", 8), ("camera", 4), ("damaged", 2), ("rusty", 2)):
        assert set(Counter(getattr(case, trait) for case in chosen).values()) == {count // kinds}


def test_no_two_cases_share_light_and_camera():
    pairs = {(case.light, case.camera) for case in reference_set.cases()}
    assert len(pairs) == len(reference_set.cases()) == 32


def test_the_scene_of_a_case_has_its_light_damage_and_rust():
    for case in reference_set.cases()[:8]:
        scene = case.drawn()
        assert scene.environment.name == case.light
        assert bool(scene.damages) == case.damaged
        assert scene.surface.rust.coverage == (reference_set.RUSTY if case.rusty else 0.0)


def test_surrounded_cases_can_be_drawn_and_are_numbered_on():
    assert [case.number for case in surrounded_cases()] == [*range(32, 39)]
    for case in surrounded_cases():
        scene = check_scene(case.drawn())
        assert scene.ground is not None
        assert len(scene.neighbours) == len(case.poses)
        assert bool(scene.props) == case.on_trailer
        if case.damage:
            (damage,) = scene.damages
            assert [damage.kind] == case.damage["kinds"]
            apart_mm = np.subtract(damage.origin_mm, case.view.target_mm)
            assert np.linalg.norm(apart_mm) < 300


def test_filters_are_the_integrals_of_a_box_and_a_tent():
    """Compare with sums of 20 samples per half pixel, weighted by each filter's formula."""
    rng = np.random.default_rng(2)
    halves = rng.random((16, 12, 3))
    kernels = {
        "box": lambda x: (abs(x) < 0.5) * 1.0,
        "tent": lambda x: np.maximum(1 - abs(x), 0.0),
    }
    fine = 20  # samples per half pixel
    rows, columns = (np.repeat(np.arange(n), fine) for n in (16, 12))
    y, x = ((np.arange(n * fine) + 0.5) / fine / 2 for n in (16, 12))
    found = reference_set.filtered(halves)
    for name, kernel in kernels.items():
        for i, j in itertools.product(range(1, 7), range(1, 5)):  # away from the border
            down, across = kernel(y - i - 0.5), kernel(x - j - 0.5)
            light = halves[rows][:, columns]
            expected = np.einsum("y,x,yxc->c", down, across, light) / (down.sum() * across.sum())
            assert np.allclose(found[name][i, j], expected, atol=1e-6)


def test_a_reference_can_be_saved_and_loaded(tmp_path):
    case = reference_set.cases()[0]
    y, x = np.mgrid[:320, :320] / 320
    smooth = np.stack([0.02 + x, 0.1 + y, 0.3 + 0.2 * x * y], axis=-1)
    inside = (x - 0.5) ** 2 + y**2 < 0.2
    depth_m = np.where(inside, 5 + x, np.inf)[::8, ::8]
    written = reference_set.Reference(
        case.drawn(),
        0.25,
        {"box": 4 * smooth},
        inside,
        depth_m,
        1 - y / 2,
    )
    reference_set.save(written, tmp_path, 0)
    read = reference_set.load(0, tmp_path)
    assert read.scene == written.scene
    assert (read.inside == inside).all()
    assert np.allclose(read.depth_m, depth_m, rtol=1e-6)
    assert np.allclose(read.openness, written.openness, atol=0.02)
    for name, radiance in written.radiance.items():
        # compression error is measured as displayed, after exposure and encoding
        shown, kept = ((0.25 * r).clip(0, 1) ** (1 / 2.2) for r in (radiance, read.radiance[name]))
        assert np.abs(shown - kept).max() < 0.02


STORED = sorted(reference_set.FOLDER.glob("*.npz"))


def test_a_balanced_set_of_cases_and_all_surrounded_ones_have_stored_references():
    stored = {int(path.stem) for path in STORED}
    assert stored == {*range(8), *(case.number for case in surrounded_cases())}


@pytest.mark.parametrize("path", STORED, ids=lambda p: p.stem)
def test_a_stored_reference_loads_and_matches_its_case(path):
    case = every_case()[int(path.stem)]
    reference = reference_set.load(case.number)
    assert reference.scene.environment.name == case.light
    assert (reference.scene.ground is not None) == (case in surrounded_cases())
    shown = reference.inside.mean()
    if isinstance(case, SurroundedCase) and case.damage:  # close up
        assert 0.8 < shown <= 1
    else:
        assert 0.02 < shown < 0.98
    for image in reference.radiance.values():
        assert np.isfinite(image).all()
        assert image.shape == (*reference.inside.shape, 3)


def test_equal_samples_for_noise_that_falls_with_the_square_root():
    curve = [(n, 0.4 / n**0.5, 0.5 + 0.1 * n) for n in (1, 2, 4, 8, 16, 32, 64)]
    found = cycles_figures.equal_samples(curve, 0.4 / 24**0.5)
    assert found.samples == pytest.approx(24, rel=1e-3)
    assert 0.5 + 0.1 * 16 < found.seconds < 0.5 + 0.1 * 32


@pytest.mark.parametrize(("error", "words"), [(0.5, "fewer than 1"), (0.01, "more than 64")])
def test_an_error_outside_the_measured_series_is_reported_as_a_bound(error, words):
    curve = [(1, 0.4, 1.0), (64, 0.05, 7.0)]
    assert cycles_figures.equal_samples(curve, error).words == words


def test_the_front_is_exactly_the_points_that_no_other_dominates():
    rng = np.random.default_rng(5)
    points = [pareto_chart.Point("fastgen", str(i), *rng.random(2)) for i in range(60)]
    unbeaten = {
        p.setting
        for p in points
        if not any(q.rate > p.rate and q.error <= p.error for q in points)
        and not any(q.rate >= p.rate and q.error < p.error for q in points)
    }
    assert {p.setting for p in pareto_chart.front(points)} == unbeaten


def functions(text):
    """Return the return type, name and parameters of each function in GLSL text."""
    return set(re.findall(r"^\w+ \w+\([^;{)]*\)(?= \{)", text, re.M))


def test_every_shader_file_of_an_ablation_replaces_functions_of_a_shader():
    replaced = [file for element in ablation_elements.ELEMENTS for file in element.files.items()]
    assert sorted(name for name, _ in replaced) == sorted(
        path.name for path in ablation_elements.STUBS.iterdir()
    )
    for name, text in replaced:
        declared = functions(text)
        assert declared, name
        assert declared <= functions(shader_text(name)), name
        assert text != shader_text(name)


def test_every_layer_that_an_ablation_leaves_out_exists():
    for element in ablation_elements.ELEMENTS:
        assert set(element.without) <= set(LAYERS) - {"all", "normals"}, element.name


@pytest.fixture(scope="module")
def rusty_case():
    """Scene, camera name and frame of a case with rust, sun and a spreader."""
    case = reference_set.cases()[5]
    scene = case.drawn()
    return scene, case.camera, drawn([], scene, case.camera)


def drawn(elements, scene, camera):
    """Return the frame of a scene without elements of shaders."""
    session = ablation_elements.gpu_session(elements, "draft")
    with session.drawing() as renderer:
        frame = renderer.render(PreparedScene(scene), scene.camera(camera), reference_set.SIZE)
    session.close()
    return frame


@pytest.mark.parametrize(
    "element",
    [e for e in ablation_elements.ELEMENTS if e.files or e.without],
    ids=lambda element: element.name,
)
def test_an_image_without_an_element_of_the_shaders_differs_but_its_labels_do_not(
    element, rusty_case
):
    scene, camera, whole = rusty_case
    frame = drawn([element], scene, camera)
    assert (frame.image != whole.image).any()
    assert np.array_equal(frame.ids, whole.ids)


def test_removing_charts_removes_only_their_triangles_and_keeps_the_groups():
    mesh = build_container("20")
    less = ablation_elements.without_charts("door.bar.")(mesh)
    names = np.array([chart.name for chart in mesh.charts])
    for name, part in mesh.groups.items():
        triangles = mesh.triangles[part]
        kept = [not names[mesh.chart[t[0]]].startswith("door.bar.") for t in triangles]
        assert np.array_equal(less.triangles[less.groups[name]], triangles[kept])


def test_mesh_edits_of_ablations_change_the_mesh():
    spreader, container = build_spreader("40HC"), build_container("20")
    for element in ablation_elements.ELEMENTS:
        for edit, mesh in ((element.spreader, spreader), (element.container, container)):
            if edit is not None:
                edited = edit(mesh)
                fewer = len(edited.triangles) < len(mesh.triangles)
                assert fewer or edited.charts != mesh.charts, element.name


@pytest.mark.parametrize("name", ["accuracy", "pareto", "ablation"])
def test_help_works_without_the_error_metrics(name):
    """A module set to None in `sys.modules` fails to import, like one that is not installed."""
    path = Path(ablation_elements.__file__).with_name(f"{name}.py")
    code = (
        "import runpy, sys; sys.modules['flip_evaluator'] = sys.modules['skimage'] = None;"
        f"sys.path.insert(0, '{path.parent}'); sys.argv = ['{name}', '--help'];"
        f"runpy.run_path('{path}', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "usage:" in done.stdout


def test_a_missing_error_metric_is_one_line_that_says_what_to_install():
    folder = Path(ablation_elements.__file__).parent
    code = (
        f"import sys; sys.modules['flip_evaluator'] = None; sys.path.insert(0, '{folder}');"
        "import numpy, image_error; image_error.flip(*[numpy.zeros((16, 16, 3))] * 2)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "pip install '.[accuracy]'" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture(scope="module")
def renderer():
    with Generator(
        Config.preset(), reference_set.SEED, reference_set.SIZE, quality="high"
    ) as generator:
        yield generator


@pytest.mark.parametrize(
    ("number", "apart"),
    [(2, 3.5), (3, 2.5), (4, 2.5), (5, 3.5), (7, 3.0), (33, 3.5), (35, 4.5)],
)
def test_an_image_matches_its_path_traced_reference(renderer, number, apart):
    """Test light, layers, damage and exposure together; `apart` limits the mean error.

    `apart` is in 8-bit steps. The cases are: rusty at night, clean in the sun, clean and overcast,
    rusty in the sun, clean at dawn, among neighbours under clouds, a stack in the sun.
    """
    case, reference = every_case()[number], reference_set.load(number)
    scene = reference.scene
    ours = renderer.render(scene=scene, camera=case.camera).image
    exposure = renderer.exposure(scene, scene.camera(case.camera))
    expected = 255 * image_error.displayed(reference.radiance[FILTERS["high"]], exposure)
    difference = (expected - ours)[reference.inside]
    assert np.abs(difference).mean() < apart
    assert np.abs(difference.mean(axis=0)).max() < 3.5
    assert expected[reference.inside].std() > 15
