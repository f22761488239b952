"""Content of disk cache entries compared with a table, so that no change forgets its VERSION."""

import numpy as np
import pytest

from fastgen.decals import artwork, glyphs
from fastgen.files import disk_cache
from fastgen.geometry import chart_sheet, container, mesh, sheet_folds, spreader
from fastgen.light import container_map, environment, indirect_light, reflectance
from fastgen.light.hdri import bundled_hdris
from fastgen.light.sky_visibility import Sky
from fastgen.render import noise, rust, sky_visibility_probe
from fastgen.render.gl import open_context

TABLE = {
    "art": (artwork, 7, 18.11144, 41.93788, 36.35176),
    "container": (container, 10, 13.13945, 66.52907, 60.88631),
    "container-map": (container_map, 3, 14.84011, 16.39247, 8.13648),
    "dfg": (reflectance, 1, 7.62462, 0.34701, 0.17011),
    "environment": (environment, 1, 14.18415, 21.35128, 20.6178),
    "folds": (sheet_folds, 1, 9.39366, 27.73207, 25.70046),
    "form-factors": (indirect_light, 2, 11.68992, 47.99234, 44.62035),
    "glyph-ink": (glyphs, 1, 15.25896, 11.61372, 10.31897),
    "hull": (mesh, 1, 2.07944, 8.73444, 8.39602),
    "noise": (noise, 1, 16.23007, 52.29057, 44.10587),
    "rust-points": (rust, 1, 8.83054, 14.69994, 12.84505),
    "sheet": (chart_sheet, 1, 12.78655, 221.11837, 198.38758),
    "sky-directions": (sky_visibility_probe, 2, 13.56723, 19.84014, 17.14778),
    "sky-visibility": (sky_visibility_probe, 2, 13.18226, 58.21188, 51.2073),
    "spreader": (spreader, 5, 11.03602, 33.203, 30.26422),
    "triangle-bounds": (mesh, 1, 11.93882, 14.59168, 13.22793),
}
"""Producer: its module, its VERSION and the summary of its entries, see `summary`."""

TOLERANCE = 1e-4
GL_TOLERANCE = 0.02
"""Depth maps, and form factors of what they hide, differ a little between OpenGL drivers."""


def summary(entries):
    """Return three numbers about entries, which do not depend on the rounding of a CPU.

    They are the logarithm of the number of values, and the sums over all arrays of log(1 + m) for
    m = mean |x|, and for m = mean |x| weighted by a ramp, which changes with the order of values.
    """
    arrays = [np.abs(array, dtype=np.float64).ravel() for each in entries for array in each]
    arrays = [array for array in arrays if array.size]
    ramps = [array * np.linspace(0, 1, array.size) for array in arrays]
    return (
        float(np.log(sum(array.size for array in arrays))),
        float(sum(np.log1p(array.mean()) for array in arrays)),
        float(sum(np.log1p(ramp.mean()) for ramp in ramps)),
    )


@pytest.fixture(scope="module")
def summaries(tmp_path_factory):
    """The summary of new entries of each producer."""
    folder = tmp_path_factory.mktemp("cache")
    original = disk_cache.cached

    def checked(name, *arguments, **options):
        """Every producer names a layout, and what it makes has it; otherwise no entry ever hits."""
        arrays = original(name, *arguments, **options)
        layout = options["layout"] if "layout" in options else arguments[4]
        assert disk_cache.fits(arrays, layout), name
        return arrays

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(disk_cache, "default_folder", lambda: folder)
        patch.setattr(disk_cache, "cached", checked)
        reflectance.dfg_table.__wrapped__()
        noise.noise_tiles.__wrapped__()
        artwork.art_levels.__wrapped__()
        glyphs.glyph_ink.__wrapped__()
        container_map.load_container_map.__wrapped__(bundled_hdris()["port_morning"])
        ambient = environment.load_environment(bundled_hdris()["night_2"])
        body = container.build_container("20")
        body.prepare(damages=True)
        _ = body.hull, body.folds
        rust.rate_of(0.1, body)
        outline, held = container.container_outline("20"), spreader.build_spreader("20")
        sky = Sky(ambient, 0.0)
        with open_context() as gl:
            probe = sky_visibility_probe.SkyVisibilityProbe(gl.ctx)
            below = probe.container_light(body, outline, held, sky)
            paints = ((0.5, 0.5, 0.5),) * len(mesh.MATERIALS)
            probe.spreader_light(held, held, body, below, sky, paints)
            probe.release()
    found = {}
    for entry in sorted(folder.glob("*.npy")):
        arrays = disk_cache.read(entry)
        found.setdefault(entry.stem.rpartition("-")[0], []).append(list(arrays.values()))
    return {name: summary(entries) for name, entries in found.items()}


def test_every_producer_is_in_the_table(summaries):
    assert sorted(summaries) == sorted(TABLE)


@pytest.mark.parametrize("name", TABLE)
def test_changed_content_has_a_new_version(summaries, name):
    module, version, *wanted = TABLE[name]
    tolerance = GL_TOLERANCE if name.startswith(("sky", "form")) else TOLERANCE
    same = summaries[name] == pytest.approx(wanted, abs=tolerance)
    row = tuple(round(number, 5) for number in summaries[name])
    raised = version != module.VERSION
    assert same or raised, (
        f"{module.__name__}: the stored arrays changed; raise its VERSION, and put {row} into TABLE"
    )
    assert not raised, (
        f"{module.__name__}: VERSION is {module.VERSION}; put it and {row} into TABLE"
    )
