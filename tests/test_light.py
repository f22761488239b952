"""Lighting of objects: relations that must hold in every environment."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.classes import CONTAINER_ID, SPREADER_ID
from fastgen.light.sky_visibility import encoded_cones, open_sky, sky_directions
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe
from tests.sky_samples import texel_grid
from tests.test_environment import write_exr

GREY = "#808080"


@pytest.fixture(scope="module", params=["balanced", "high"])
def generator(request, tmp_path_factory):
    """Generator of grey objects under three coloured lamps, in three orders of the colours."""
    folder = tmp_path_factory.mktemp("skies")
    toward = np.array([[0.0, -1.0, 0.2], [0.8, 0.3, 0.5], [-0.5, 0.2, -0.8]])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    sky = 0.02 + np.maximum(texel_grid(128)[0] @ toward.T, 0) ** 2
    for order in ([0, 1, 2], [1, 2, 0], [2, 1, 0]):
        name = "".join("rgb"[i] for i in order)
        write_exr(folder / f"{name}.exr", np.ascontiguousarray(sky[..., order], np.float32))
    plain = Config.from_values(
        {
            # scraped steel and its rust are coloured
            "surface": {"colors": {"grey": GREY}, "rust_coverage": [0, 0], "scrapes": [0, 0]},
            "spreader": {"colors": [GREY]},
            "damage": {"probability": 0},
        }
    )
    with Generator(plain, 7, (160, 160), quality=request.param, hdri_dir=folder) as made:
        yield made


@pytest.mark.parametrize("camera", ["A", "Cl"])
@pytest.mark.parametrize("order", [[1, 2, 0], [2, 1, 0]])
def test_permuting_the_skys_channels_permutes_the_images_channels(generator, camera, order):
    """Each channel of the light affects only the same channel of the image."""
    scene = replace(generator.scene(3), decals=())

    def under(name: str, times: float) -> tuple[np.ndarray, float]:
        shown = replace(scene, environment=replace(scene.environment, name=name))
        taken = shown.camera(camera)
        taken = replace(taken, exposure_ev=taken.exposure_ev + np.log2(times))
        image = generator.render(scene=shown, camera=taken).image
        return image.astype(int), generator.exposure(shown, taken)

    first, exposure = under("rgb", 1.0)
    name = "".join("rgb"[i] for i in order)
    metered = under(name, 1.0)[1]  # luminance weights the channels unequally
    image, same = under(name, exposure / metered)
    assert same == pytest.approx(exposure)
    assert np.abs(image - first).mean() > 10
    # several steps round to 8 bits
    assert np.abs(image - first[..., order]).max() <= 6


@pytest.mark.parametrize(("camera", "follows"), [("A", True), ("B", False)])
def test_exposure_follows_the_light_on_the_visible_side(tmp_path, camera, follows):
    """A lamp in front of the front side, outside both views, becomes sixteen times as bright."""
    toward = texel_grid(128)[0]
    lamp = np.maximum(toward @ [0.0, -0.6, 0.8] - 0.9, 0)[..., None] * np.ones(3)
    for name, times in (("dim", 1.0), ("bright", 16.0)):
        write_exr(tmp_path / f"{name}.exr", (0.02 + times * lamp).astype(np.float32))
    with Generator(Config.preset(), 7, (64, 64), hdri_dir=tmp_path) as made:
        scene = made.scene(3)
        dim, bright = (
            made.exposure(
                replace(scene, environment=replace(scene.environment, name=name, yaw_deg=0.0)),
                scene.camera(camera),
            )
            for name in ("dim", "bright")
        )
    assert bright <= dim
    assert (bright < 0.5 * dim) == follows


LIT = Config.from_values(
    {
        "damage": {"probability": 0.0},
        "spreader": {"probability": 1.0, "colors": ["#ffffff"]},
        "surface": {"colors": {"paint": "#ffffff"}},
        "environment": {"names": ["port_overcast"]},
        "cameras": {"low": {"face": "no_door", "focal_mm": 45, "distance_mm": 6000}},
    }
)


def lit_by(monkeypatch, values):
    """Render scene 0 with stored vertex light from `values` in place of probed light.

    values: function from normals float [V, 3] to uint8 [V, VERTEX_BYTES].
    """

    def seen(mesh):
        return LitMesh(mesh, values(mesh.normals), *[np.ones(mesh.normals.shape, np.float32)] * 2)

    with monkeypatch.context() as patch:
        patch.setattr(SkyVisibilityProbe, "container_light", lambda _, mesh, *others: seen(mesh))
        patch.setattr(SkyVisibilityProbe, "spreader_light", lambda _, mesh, *others: seen(mesh))
        with Generator(LIT, seed=1, size=(128, 128)) as generator:
            return generator.render(index=0, camera="low")


def test_vertex_light_is_three_channels_scaled_by_a_fourth(monkeypatch):
    """On container and spreader, 60 at scale 4 is as bright as 120 at scale 2."""

    def values(steps, times):
        def of(normals):
            found = open_sky(normals)
            found[:, 4:8] = (*steps, times)
            return found

        return of

    images = [
        lit_by(monkeypatch, values(*light)).image.astype(int)
        for light in (((60, 40, 20), 12), ((120, 80, 40), 4), ((120, 80, 40), 0))
    ]
    assert np.abs(images[0] - images[1]).max() <= 1
    assert np.abs(images[1] - images[2]).mean() > 10


def test_only_containers_get_estimated_light_from_their_hidden_sky(monkeypatch):
    """The hidden part of a container's sky counts as light reflected by paint.

    A spreader's stored values include that light already.
    """

    def dark(normals):
        found = open_sky(normals)
        found[:, :3] = encoded_cones(normals, normals @ sky_directions().T > 0.8)
        found[:, 4:8] = 0
        found[:, 8:] = 0
        return found

    sample = lit_by(monkeypatch, dark)
    spreader, container = (
        np.median(sample.image[sample.ids == number]) for number in (SPREADER_ID, CONTAINER_ID)
    )
    assert spreader < 0.2 * container
