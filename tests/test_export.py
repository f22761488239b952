"""Files from `fastgen export`, read back by trimesh and hit with Embree rays."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.camera.projection import view_of
from fastgen.classes import SPREADER_ID
from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.export import export_glb
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import in_hole
from fastgen.geometry.damaged_mesh import damaged_mesh
from fastgen.scene import Camera, Ground, Neighbour, Pose, Prop, Scene, Spreader
from fastgen.scene.optics import Lens
from tests.exported import TO_Z_UP, Exported, tree_of

SIZE = (320, 240)
GREY = (0.2, 0.2, 0.2)
TORN = Config.from_values(
    {
        "container": {"kinds": {"20": 1}},
        "damage": {"probability": 1, "count": [4, 4]},
        "spreader": {"probability": 0},
    }
)


@pytest.fixture(scope="module")
def generator():
    with Generator(TORN, seed=2, size=SIZE, quality="draft") as made:
        yield made


def holes(scene):
    return [d for d in scene.damages if d.kind == "perforation"]


@pytest.fixture(scope="module")
def torn(generator, tmp_path_factory):
    """A scene with holes in the door and in a side wall, and its exported file."""
    scenes = (generator.scene(index) for index in range(200))
    faces = ((scene, {damage.face for damage in holes(scene)}) for scene in scenes)
    scene = next(s for s, torn in faces if "door" in torn and torn & {"front", "back"})
    path = tmp_path_factory.mktemp("export") / "torn.glb"
    export_glb(generator, scene, path, texel_mm=8.0)
    return scene, Exported(path), path.read_bytes()


def head_on(scene: Scene, face_y: float, x_mm: float, z_mm: float) -> Camera:
    """Return a camera that looks straight at (x, z) on the front, at 4 mm per pixel."""
    distance_mm = 6000.0
    focal_mm = distance_mm / (4.0 * SIZE[0]) * 36.0
    position = (x_mm, face_y - distance_mm, z_mm)
    return Camera("straight", position, (x_mm, face_y, z_mm), focal_mm)


def bare(scene: Scene) -> Scene:
    """Return `scene` with only paint and decals: no other layers and no damage."""
    surface = scene.surface
    surface = replace(
        surface,
        paint=replace(surface.paint, tone_variation=0.0, bleach=0.0),
        ageing=replace(surface.ageing, strength=0.0),
        dirt=replace(surface.dirt, strength=0.0, streaks=0.0),
        rust=replace(surface.rust, coverage=0.0),
        scratches=replace(surface.scratches, coverage=0.0, scrapes=0.0),
    )
    return replace(scene, surface=surface, damages=())


@pytest.mark.parametrize("camera", ["A", "B", "Cl", "Cr"])
def test_exported_geometry_has_the_rendered_silhouette(generator, torn, camera):
    scene, exported, _ = torn
    sample = generator.render(scene=scene, camera=camera)
    triangle, _ = exported.first_hits(camera, exported.whole)
    wrong = (triangle >= 0).reshape(sample.ids.shape) != (sample.ids > 0)
    assert wrong.mean() < 5e-4


@pytest.mark.parametrize("camera", ["A", "B", "Cl", "Cr"])
def test_exported_geometry_has_the_rendered_depth(generator, torn, camera):
    scene, exported, _ = torn
    sample = generator.render(scene=scene, camera=camera)
    triangle, depth = exported.first_hits(camera, exported.whole)
    both = (triangle >= 0) & (sample.ids.ravel() > 0)
    error = np.abs(depth[both] - sample.depth.ravel()[both])
    # through a hole, exported inner faces lie deeper by the thickness of the steel; beside a hole,
    # exported locking bars bend in finer steps
    assert np.quantile(error, 0.995) < 4e-3


@pytest.mark.parametrize("camera", ["A", "Cr"])
def test_the_exported_spreader_has_the_rendered_silhouette_and_depth(generator, tmp_path, camera):
    scene = generator.scene(1)
    scene = replace(bare(scene), spreader=Spreader(present=True, gap_mm=20.0))
    export_glb(generator, scene, tmp_path / "held.glb", [scene.camera(camera)], 16.0)
    exported = Exported(tmp_path / "held.glb")
    sample = generator.render(scene=scene, camera=camera)
    triangle, depth = exported.first_hits(camera, exported.whole)
    first = len(exported.parts["container"].faces)
    wrong = (triangle >= first).reshape(sample.ids.shape) != (sample.ids == SPREADER_ID)
    assert wrong.mean() < 5e-4
    seen = (triangle >= first) & (sample.ids.ravel() == SPREADER_ID)
    assert seen.sum() > 100
    # at outlines the two may hit different beams
    assert np.quantile(np.abs(depth[seen] - sample.depth.ravel()[seen]), 0.995) < 1e-3


def test_the_exported_spreader_has_the_rendered_paint(generator, tmp_path):
    scene = bare(generator.scene(0))
    scene = replace(scene, spreader=Spreader(present=True, albedo=(0.5, 0.1, 0.02)))
    export_glb(generator, scene, tmp_path / "held.glb", [], 16.0)
    skin = Exported(tmp_path / "held.glb").parts["spreader"].visual.material.baseColorTexture
    typical = np.median(np.asarray(skin.convert("RGB")).reshape(-1, 3), axis=0) / 255
    linear = ((typical + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(linear, (0.5, 0.1, 0.02), rtol=0.03, atol=2e-3)


def test_holes_are_cut_to_within_a_millimetre(torn):
    scene, *_ = torn
    hole = next(hole for hole in holes(scene) if hole.face != "door")  # gear would hide it
    rest = build_container(scene.container.kind, scene.container.profiles)
    flat = replace(hole, depth_mm=0.0)
    cut = damaged_mesh(rest, (flat,))
    body = RayMeshIntersector(trimesh.Trimesh(cut.positions_mm, cut.triangles, process=False))
    whole = RayMeshIntersector(trimesh.Trimesh(rest.positions_mm, rest.triangles, process=False))
    reach = np.linspace(-hole.size_mm[0], hole.size_mm[0], 161)
    u, v = (axis.ravel() for axis in np.meshgrid(reach, reach))
    along, across, inward = (np.array(a) for a in (hole.along, hole.across, hole.inward))
    start = np.array(hole.origin_mm) + u[:, None] * along + v[:, None] * across - 600 * inward
    rays = np.tile(inward, (len(start), 1))
    distance = []
    for caster in (body, whole):
        triangle = caster.intersects_first(start, rays)
        mesh = caster.mesh
        corners = mesh.triangles[triangle]
        normal = mesh.face_normals[triangle]
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((corners[:, 0] - start) * normal).sum(1) / (rays * normal).sum(1)
        distance.append(np.where(triangle >= 0, depth, np.inf))
    open_here = distance[0] > distance[1] + 1e-3
    point = start + np.where(np.isfinite(distance[1]), distance[1], 0)[:, None] * rays
    turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    around = [in_hole(hole, point + np.cos(t) * along + np.sin(t) * across) for t in turns]
    shrunk, grown = np.all(around, axis=0), np.any(around, axis=0)
    hit = np.isfinite(distance[1])
    assert shrunk[hit].any()
    assert open_here[hit & shrunk].all()
    assert not open_here[hit & ~grown].any()


def test_normals_of_a_bent_wall_match_its_triangles(generator):
    scenes = (generator.scene(index) for index in range(50))
    damages = next(d for s in scenes for d in s.damages if d.kind == "concave")
    rest = build_container("20", generator.scene(0).container.profiles)
    bent = damaged_mesh(rest, (damages,))
    body = trimesh.Trimesh(bent.positions_mm, bent.triangles, process=False)
    given = bent.normals[bent.triangles].mean(axis=1)
    cosine = (body.face_normals * given).sum(1) / np.linalg.norm(given, axis=1)
    area = body.area_faces
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1)) @ area / area.sum()) < 0.5


def test_base_color_matches_the_unlit_render(generator, tmp_path):
    scene = bare(generator.scene(0))
    names = [d for d in scene.decals if d.face == "front"]
    mesh = build_container(scene.container.kind, scene.container.profiles)
    place, _ = mesh.sheet_to_surface("front", names[0].center_mm)
    camera = head_on(scene, float(mesh.bounds_mm[0][1]), float(place[0, 0]), float(place[0, 2]))
    path = tmp_path / "bare.glb"
    export_glb(generator, scene, path, [camera], texel_mm=2.0)
    exported = Exported(path)
    sample = generator.render(scene=scene, camera=camera, layer="decals")
    baked = exported.texel(exported.visual.material.baseColorTexture.convert("RGB"), "straight")
    shown = sample.image.reshape(-1, 3).astype(float)
    seen = (sample.ids.ravel() > 0) & np.isfinite(baked[:, 0])
    assert np.ptp(shown[seen], axis=0).max() > 60
    error = np.abs(baked - shown)[seen].max(axis=1)
    # in 8-bit steps; on slanted corrugation footprints differ, which blurs edges differently
    assert np.quantile(error, 0.95) <= 1.0
    assert error.mean() < 0.8  # the view is full of letters


def test_roughness_matches_the_unlit_render(generator, tmp_path):
    scene = replace(generator.scene(0), damages=())
    mesh = build_container(scene.container.kind, scene.container.profiles)
    camera = head_on(scene, float(mesh.bounds_mm[0][1]), 0.0, 1300.0)
    path = tmp_path / "rough.glb"
    export_glb(generator, scene, path, [camera], texel_mm=4.0)
    exported = Exported(path)
    sample = generator.render(scene=scene, camera=camera, layer="reflection")
    texture = exported.visual.material.metallicRoughnessTexture.convert("RGB")
    baked = exported.texel(texture, "straight")[:, 1]
    shown = sample.image[..., 0].ravel().astype(float)
    error = np.abs(baked - shown)[np.isfinite(baked)]
    assert np.ptp(shown) > 10
    assert error.mean() < 2.0


def test_the_file_stores_scene_light_and_exposure(generator, torn):
    scene, exported, _ = torn
    extras = exported.tree["scenes"][0]["extras"]
    assert Scene.from_json(json.dumps(extras["scene"])) == scene
    assert extras["environment"]["name"] == scene.environment.name
    assert extras["environment"]["yaw_deg"] == scene.environment.yaw_deg
    nodes = {n["name"]: n for n in exported.tree["nodes"] if "camera" in n}
    assert set(nodes) == {camera.name for camera in scene.cameras}
    for camera in scene.cameras:
        expected = generator.exposure(scene, camera)
        assert nodes[camera.name]["extras"]["exposure"] == expected


@pytest.fixture(scope="module")
def surrounded(generator, tmp_path_factory):
    """A scene with a turned neighbour, ground and props, and its file."""
    scene = replace(generator.scene(0), spreader=Spreader(), damages=())
    other = generator.scene(1)
    neighbour = Neighbour(
        Pose((500.0, 4200.0, -300.0), 170.0), other.container, other.surface, other.decals
    )
    camera = Camera("around", (9000.0, -5000.0, 5000.0), (1000.0, 1000.0, 0.0), 20.0)
    scene = replace(
        scene,
        cameras=(camera,),
        neighbours=(neighbour,),
        ground=Ground("concrete", -800.0, wear=0.0, reach_mm=8000.0),
        props=(
            Prop("box", Pose((3500.0, -2500.0, -500.0), 20.0), (700.0, 300.0, 600.0), (0.1,) * 3),
            Prop(
                "cylinder", Pose((500.0, -2400.0, -500.0), 40.0), (600.0, 900.0, 600.0), (0.2,) * 3
            ),
        ),
    )
    path = tmp_path_factory.mktemp("surrounded") / "scene.glb"
    export_glb(generator, scene, path, texel_mm=32.0)
    return scene, path


def test_neighbours_ground_and_props_are_where_the_renderer_draws_them(generator, surrounded):
    scene, path = surrounded
    sample = generator.render(scene=scene)
    loaded = trimesh.load(path, process=False)
    body = trimesh.util.concatenate(list(loaded.dump()))
    body.vertices = body.vertices @ TO_Z_UP.T
    view = sample.view
    eye_mm, rays = view.rays()
    rays = rays.reshape(-1, 3)
    origins = np.tile(eye_mm / 1e3, (len(rays), 1))
    hits, which, _ = RayMeshIntersector(body).intersects_location(origins, rays, False)
    depth = np.full(len(rays), np.inf)
    depth[which] = (hits - eye_mm / 1e3) @ view.rotation[2]
    shown = sample.depth.ravel()
    both = np.isfinite(depth) & np.isfinite(shown)
    assert both.mean() > 0.4
    # a cylinder of 64 sides, and corners of the square beyond the ground's reach
    assert np.quantile(np.abs(depth[both] - shown[both]), 0.98) < 2e-3
    assert (np.isfinite(depth) | ~np.isfinite(shown)).mean() > 0.999


def test_the_dry_ground_reflects_no_highlights_and_fades(surrounded):
    scene, path = surrounded
    tree = tree_of(path)
    (material,) = (m for m in tree["materials"] if m["name"] == "ground")
    assert material["extensions"]["KHR_materials_specular"]["specularFactor"] == 0.0
    assert "KHR_materials_specular" in tree["extensionsUsed"]
    image = trimesh.load(path, process=False).geometry["ground"].visual.material.baseColorTexture
    alpha = np.array(image)[..., 3]
    rows, columns = alpha.shape
    assert alpha[rows // 2, columns // 2] == 255
    assert alpha[0, 0] == 0
    assert abs(int(alpha[rows // 2, columns * 7 // 8]) - 128) < 4  # three quarters of the reach
    color = np.array(image)[..., :3].reshape(-1, 3).mean(axis=0) / 255
    linear = ((color + 0.055) / 1.055) ** 2.4
    assert linear == pytest.approx(np.array(scene.ground.albedo), rel=0.15)


def test_lens_distortion_is_stored_in_the_extras_of_its_camera(generator, tmp_path):
    scene = generator.scene(0)
    lens = Lens("brown_conrady", (-0.1, 0.02, 1e-3, 0.0, 0.0))
    bent = replace(scene.cameras[0], lens=lens)
    export_glb(generator, scene, tmp_path / "bent.glb", [bent, scene.cameras[1]], 20.0)
    nodes = {node["name"]: node for node in tree_of(tmp_path / "bent.glb")["nodes"]}
    extras = nodes[bent.name]["extras"]
    assert (extras["distortion_model"], extras["distortion"]) == (lens.model, [*lens.coefficients])
    assert "distortion" not in nodes[scene.cameras[1].name]["extras"]


def test_gltf_cameras_match_the_pixels_of_the_renderer(torn):
    scene, exported, _ = torn
    for camera in scene.cameras:
        origin, rays = exported.rays(camera.name)
        pixels, depth = view_of(camera, SIZE).project((origin + 3 * rays) * 1e3)
        grid = np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), axis=-1)
        np.testing.assert_allclose(pixels, grid.reshape(-1, 2), atol=1e-4)
        np.testing.assert_allclose(depth, 3.0, atol=1e-6)


def test_the_same_scene_makes_the_same_file(generator, torn, tmp_path):
    scene, _, data = torn
    export_glb(generator, scene, tmp_path / "again.glb", texel_mm=8.0)
    assert (tmp_path / "again.glb").read_bytes() == data


def test_baking_does_not_change_the_next_frame(generator, torn):
    scene, *_ = torn
    before = generator.render(scene=scene, camera="B")
    generator.bake(scene, 32.0)
    after = generator.render(scene=scene, camera="B")
    np.testing.assert_array_equal(before.image, after.image)
    np.testing.assert_array_equal(before.damage, after.damage)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["-o", "box.obj"], "box.obj: give a file name that ends in .glb"),
        (["-o", "box.glb", "--camera", "Cx"], "camera: 'Cx' is unknown"),
        (["-o", "box.glb", "--texel-mm", "0"], "texel_mm: 0.0 is not a size"),
        (["-o", "box.glb", "--texel-mm", "nan"], "texel_mm: nan is not a size"),
        (["-o", "box.glb", "--texel-mm", "0.5"], "or more for this container"),
        (["-o", "none/box.glb"], "no folder none"),
        (["-o", "box.glb", "--size", "9x9"], "size: 9x9 is out of range"),
    ],
)
def test_bad_input_gets_one_line(arguments, named, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["export", "--index", "0", *arguments]) == 2
    error = capsys.readouterr().err
    assert named in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
