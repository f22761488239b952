"""A new kind of damage needs only the files that the table of docs/architecture.md names."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fastgen
from fastgen.resources import asset_path, shader_path

FIELD = '''"""Sheet that waves up and down. shaders/damage_buckled.glsl is the GLSL twin."""

import numpy as np

from fastgen.geometry.damage_forms.form import Array, Form, bump, half_size
from fastgen.scene import Damage


def _waved(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    half_length, half_width = half_size(damage)
    wave = np.cos(2 * np.pi * u / damage.shape[0])
    return damage.depth_mm * wave * bump(u / half_length) * bump(v / half_width)


def _span(damage: Damage) -> tuple[float, float]:
    return -abs(damage.depth_mm), abs(damage.depth_mm)


BUCKLED = Form("buckle", "plain", "buckled", _waved, half_size, _span)
'''

SHADER = """// DamageField buckled_field(int i, vec3 q): waves of a buckled sheet.
// Twin of fastgen/geometry/damage_forms/buckled.py.

#include "units.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageField buckled_field(int i, vec3 q) {
    vec2 half_size = vec2(damage_along[i].w, damage_across[i].w);
    float depth = damage_inward[i].w * sheet_fade(q.z);
    float turn = 2.0 * PI / damage_shape[3 * i].x, angle = turn * q.x;
    vec2 t = q.xy / half_size;
    float along = bump(t.x), across = bump(t.y);
    float slope_u = cos(angle) * bump_slope(t.x) / half_size.x -
                    sin(angle) * turn * along;
    float slope_v = cos(angle) * along * bump_slope(t.y) / half_size.y;
    return DamageField(depth * cos(angle) * along * across,
                       depth * vec3(slope_u * across, slope_v, 0.0), 0.5 * along * across);
}
"""

CHANGES = {
    "fastgen/classes.py": ('(*DAMAGE_CLASSES, "scrape")', '(*DAMAGE_CLASSES, "scrape", "buckle")'),
    "fastgen/geometry/damage_forms/__init__.py": (
        "from fastgen.geometry.damage_forms.creased import CREASED",
        "from fastgen.geometry.damage_forms.buckled import BUCKLED\n"
        "from fastgen.geometry.damage_forms.creased import CREASED",
        "KINKED, SCRAPED)",
        "KINKED, BUCKLED, SCRAPED)",
    ),
    "fastgen/scene/damage_shapes.py": (
        '    ("scrape", "plain"): (',
        '    ("buckle", "plain"): (_mm("wavelength"),),\n    ("scrape", "plain"): (',
    ),
    "fastgen/sampling/damage_forms.py": (
        '    "scrape": draw_scrape,\n',
        '    "scrape": draw_scrape,\n'
        '    "buckle": lambda c, face, size, rng: SheetForm((1500.0, 1200.0), 90.0, (700.0,)),\n',
    ),
    "shaders/damage_law.glsl": (
        '#include "damage_scraped.glsl"\n',
        '#include "damage_scraped.glsl"\n#include "damage_buckled.glsl"\n',
    ),
}


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """A folder of sys.path with a copy of fastgen that has the kind `buckle`."""
    site = tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(fastgen.__file__).parent, site / "fastgen", ignore=ignored)
    shutil.rmtree(site / "fastgen/shaders", ignore_errors=True)
    shutil.copytree(shader_path(), site / "shaders", ignore=ignored)
    if not (site / "fastgen/assets").exists():
        (site / "assets").symlink_to(asset_path(), target_is_directory=True)
    (site / "fastgen/geometry/damage_forms/buckled.py").write_text(FIELD)
    (site / "shaders/damage_buckled.glsl").write_text(SHADER)
    for name, texts in CHANGES.items():
        text = (site / name).read_text()
        for old, new in zip(texts[::2], texts[1::2], strict=True):
            assert text.count(old) == 1, (name, old)
            text = text.replace(old, new)
        (site / name).write_text(text)
    return site


def run(site, *arguments):
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
        cwd=site,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def dataset(changed, tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "out"
    given = ["--images", 8, "--size", "256x256", "--quality", "draft"]
    given += ["--set", "damage={probability: 1, count: 3, kinds: [buckle]}"]
    run(changed, "-m", "fastgen", "generate", out, *given)
    return out


def test_masks_and_categories_have_the_new_kind(dataset):
    values = set()
    for path in (dataset / "damage/masks").rglob("*.png"):
        values |= set(np.unique(np.array(Image.open(path))).tolist())
    assert values & set(range(701, 800))
    assert values <= {0, 101, *range(701, 800)}
    found = set()
    for path in (dataset / "damage").glob("coco_*.json"):
        coco = json.loads(path.read_text())
        names = {each["id"]: each["name"] for each in coco["categories"]}
        found |= {names[each["category_id"]] for each in coco["annotations"]}
    assert found == {"container", "buckle"}


def test_the_dataset_is_whole_and_its_statistics_name_the_kind(changed, dataset):
    assert "whole and consistent" in run(changed, "-m", "fastgen", "verify", dataset)
    table = run(changed, "-m", "fastgen", "stats", dataset)
    (row,) = (line for line in table.splitlines() if line.startswith("buckle"))
    assert sum(map(int, row.split()[1:])) > 0


DEPTHS = """
import numpy as np
from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from tests import oracle

config = Config.from_values({"damage": {"probability": 1, "count": 3, "kinds": ["buckle"]}})
with Generator(config, seed=5, size=(256, 192)) as generator:
    sample = generator.render(1, "A")
    mesh = PreparedScene(sample.scene).container
    hits = oracle.cast(mesh, sample.view, sample.scene)
    assert (oracle.object_ids(sample.scene, mesh, hits) != sample.ids).mean() < 2e-4
print("equal")
"""


def test_drawn_ids_are_those_of_rays_at_the_mesh_that_numpy_deforms(changed):
    root = Path(__file__).parent.parent
    code = f"import sys; sys.path.append({str(root)!r})\n{DEPTHS}"
    assert run(changed, "-c", code) == "equal\n"
