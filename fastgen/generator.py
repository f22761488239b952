"""Generator: the public way from (config, seed, index) to a labelled Sample."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Any, Self

from fastgen.camera.projection import view_of
from fastgen.camera.sensor import apply_camera_model, is_needed, needs_radiance
from fastgen.config.config import Config, LabelConfig
from fastgen.errors import ConfigError
from fastgen.geometry.damage_law import seen_damages, variant
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.objects import label
from fastgen.labels.visibility import Shot
from fastgen.light.environment import EnvironmentLight, irradiance_at, load_environment
from fastgen.light.hdri import bundled_hdris, bundled_weights, hdris_by_name
from fastgen.render.cuda import CudaFrame, cuda_reason
from fastgen.render.gl import open_context
from fastgen.render.passes.bake import Atlas
from fastgen.render.renderer import Renderer
from fastgen.render.session import Opened
from fastgen.render.settings import QUALITY, RenderSettings
from fastgen.render.shadow_map import shader_lights
from fastgen.render.variant import LAYERS
from fastgen.sample import Sample
from fastgen.sampling.coverage import (
    damage_variant_configs,
    extreme_lenses,
    possible_shapes,
    single_container_configs,
)
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Camera, Color, EnvironmentView, Scene
from fastgen.scene.check import check_camera, check_scene
from fastgen.validation import check_fields, check_known, nearest, whole

_BRIGHTEST_AIR = 0.65
"""Light of fog that an exposure meter lets through: short of the tone curve's shoulder."""


def find_camera(scene: Scene, name: str | None = None) -> Camera:
    """The camera of `scene` called `name`, by default the first.

    Raises ConfigError that names the nearest one.
    """
    names = [camera.name for camera in scene.cameras]
    if not names:
        raise ConfigError("camera: the scene has none; give a Camera")
    if name is None:
        return scene.cameras[0]
    check_known("camera", name, names)
    return scene.camera(name)


class Generator:
    """Makes scenes and renders them. A context manager; GL is opened at the first render.

    config: the distribution. seed: whole number of 0 or more. size: (width, height) in pixels,
    64 to 4096 each. backend: auto, egl or osmesa. hdri_dir: folder of .hdr and .exr files to use
    in place of the bundled ones. quality: draft (one sample a pixel, shaded once for those of two
    by two that see one facet, in a coarser shadow of the sun), balanced (nine, materials looked up
    twice), fine (25, and as often), or high (as fine, and light found by rays, which Embree casts
    on the CPU whatever draws). Fine and high take nine samples of images of more than about a
    megapixel or 1638 rows, as 25 of a scene with holes take 2 kB a pixel. Where textures end at
    16384 texels, as Mesa's do, all but draft take four of images of more than 2730 rows.
    device_index: which of EGL's devices draws, as `fastgen doctor` numbers them; None takes the
    first that works. Threads may share it, and draw in turn; make one in each process. An image
    much taller than wide takes more memory than one lying, see sample_lattice.py.

    A process that is forked off, or that gets it pickled, opens a context of its own. What one that
    was dropped unclosed held is freed when the next opens one.
    Raises ConfigError for a bad argument, and for high where there is no Embree; AssetError for a
    bad HDRI, ContextError without OpenGL.
    """

    def __init__(
        self,
        config: Config | None = None,
        seed: int = 0,
        size: tuple[int, int] = (640, 640),
        backend: str = "auto",
        hdri_dir: str | Path | None = None,
        quality: str = "balanced",
        device_index: int | None = None,
    ) -> None:
        self.config = Config.checked(config)
        self.seed = whole("seed", seed)
        self.settings = RenderSettings(size, quality, backend, device_index, hdri_dir)
        _check_lenses(self.config, self.settings.size)
        self._hdris = bundled_hdris() if hdri_dir is None else hdris_by_name(hdri_dir)
        self._weights = (
            bundled_weights() if hdri_dir is None else dict.fromkeys(sorted(self._hdris), 1.0)
        )
        # the cameras of a scene are usually rendered one after the other
        self._sampled: tuple[tuple[Config, int, int], PreparedScene] | None = None
        self._given: PreparedScene | None = None
        self._gpu = Opened(
            partial(open_context, self.settings.backend, self.settings.device_index),
            partial(
                Renderer,
                light=partial(_load_light, self._hdris),
                quality=QUALITY[quality],
                mask_threshold_mm=self.config.damage.mask_threshold_mm,
            ),
        )

    @classmethod
    def of(cls, config: Config | None, seed: int, settings: RenderSettings) -> Self:
        """Return a Generator with these settings."""
        return cls(config, seed, **vars(settings))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the images in pixels."""
        return self.settings.size

    @property
    def environments(self) -> dict[str, float]:
        """Name -> weight in the draw of the HDRIs at hand, sorted; those of a folder weigh 1."""
        return dict(self._weights)

    @property
    def environment_record(self) -> dict[str, dict[str, Any]]:
        """What decides scenes' light: by name, an HDRI's SHA-256 and its weight in the draw."""
        sha256 = {n: hashlib.sha256(p.read_bytes()).hexdigest() for n, p in self._hdris.items()}
        return {n: {"sha256": sha256[n], "weight": w} for n, w in self._weights.items()}

    @property
    def renderer_name(self) -> str:
        """The driver's name for what renders, such as 'llvmpipe (LLVM 15.0.6, 256 bits)'."""
        with self._gpu.drawing():
            return self._gpu.context().renderer

    @property
    def used_backend(self) -> str:
        """Which backend 'auto' came to: egl or osmesa."""
        with self._gpu.drawing():
            return self._gpu.context().backend

    def scene(self, index: int) -> Scene:
        """Scene number `index`: plain data, no GL needed, the same on every machine."""
        key = (self.config, self.seed, whole("index", index))
        sampled = self._sampled  # another thread may replace it
        if sampled is None or sampled[0] != key:
            scene = sample_scene(*key, self.environments)
            self._sampled = sampled = key, PreparedScene(scene)
        return sampled[1].scene

    def render(
        self,
        index: int | None = None,
        camera: str | Camera | None = None,
        scene: Scene | None = None,
        layer: str = "all",
        normals: bool = False,
        labels: LabelConfig | None = None,
    ) -> Sample:
        """One labelled image of scene `index`, or of `scene` when that is given.

        camera: the name of one of the scene's cameras, or a Camera of your own; by default the
        scene's first. layer: 'all', or one material layer by itself, of programs.LAYERS.
        normals: give Sample.normals too. labels: what becomes of
        objects that are hard to see, in place of config.labels.
        Raises ConfigError for what cannot be drawn, by its name.
        """
        if labels is not None:
            check_fields(labels, LabelConfig, "labels")
        check_known("layer", layer, LAYERS)
        prepared, camera = self._chosen(index, camera, scene)
        scene, view = prepared.scene, view_of(camera, self.size)
        with self._gpu.drawing() as renderer:
            modelled = layer == "all" and is_needed(camera, scene.weather)
            radiance = modelled and needs_radiance(camera, scene.weather)
            frame = renderer.render(prepared, camera, self.size, layer, radiance, normals)
            if modelled:
                airlight = self._airlight(renderer, scene, camera)
                image = apply_camera_model(frame, view, camera, scene.weather, airlight)
                frame = replace(frame, image=image)
        config = self.config if labels is None else replace(self.config, labels=labels)
        objects = label(Shot(frame, prepared, view, config))
        return Sample(
            image=frame.image,
            cover=frame.cover,
            ids=frame.ids,
            damage=frame.damage,
            depth=frame.depth,
            scene=scene,
            camera=camera,
            view=view,
            objects=objects,
            normals=frame.normals,
        )

    def _airlight(self, renderer: Renderer, scene: Scene, camera: Camera) -> Color:
        """Mean light from around in the camera's exposure, no more than its meter would admit."""
        light = renderer.ambient(scene.environment.name)
        around = [[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
        mean = irradiance_at(light, around, scene.environment.yaw_deg).mean(axis=0)
        mean = mean * renderer.exposure(scene, camera, self.size)
        red, green, blue = (mean * min(1.0, _BRIGHTEST_AIR / float(mean.max()))).tolist()
        return red, green, blue

    def render_cuda(
        self,
        index: int | None = None,
        camera: str | Camera | None = None,
        scene: Scene | None = None,
    ) -> CudaFrame:
        """As `render`, but the frame stays on the GPU, without objects; good until the next call.

        The sensor's part and fog and rain, which the CPU adds, are left out.

        Raises ContextError where `cuda_reason` gives one.
        """
        prepared, camera = self._chosen(index, camera, scene)
        with self._gpu.drawing() as renderer:
            frames = self._gpu.frames(self.size)
            image, labels, depth = frames.take(renderer.draw(prepared, camera, self.size))
        return CudaFrame(image, labels, depth, prepared.scene, camera, view_of(camera, self.size))

    def cuda_reason(self) -> str:
        """Why `render_cuda` cannot work here, in one line; '' where it can."""
        with self._gpu.drawing():
            return cuda_reason(self._gpu.context())

    def bake(self, scene: Scene, texel_mm: float = 4.0) -> Atlas:
        """All material layers of a scene's container as textures; texel_mm: width of a texel.

        Raises ConfigError for a texel so small that the atlas would pass bake.MAX_ATLAS.
        """
        with self._gpu.drawing() as renderer:
            return renderer.bake(self._prepared(scene), texel_mm)

    def bake_spreader(self, scene: Scene, texel_mm: float = 4.0) -> Atlas | None:
        """As `bake`, of the spreader; None where the scene has none."""
        with self._gpu.drawing() as renderer:
            return renderer.bake_spreader(self._prepared(scene), texel_mm)

    def exposure(self, scene: Scene, camera: Camera) -> float:
        """Factor on linear radiance, ahead of the tone curve, with which `camera` takes `scene`."""
        with self._gpu.drawing() as renderer:
            checked = self._prepared(scene).scene
            return renderer.exposure(checked, check_camera(camera, checked.container), self.size)

    def preload(self, on_step: Callable[[], None] = lambda: None) -> None:
        """Make every light and shape that scenes may have, so that neither time nor memory grows
        later. on_step: called before each of them and each way to draw, which take seconds the
        first time."""
        scene = self.scene(0)
        drawn = [name for name, weight in self._weights.items() if weight > 0]
        names = self.config.environment.names or drawn
        lit = (
            PreparedScene(replace(scene, environment=EnvironmentView(name, 0.0))) for name in names
        )
        shaped = [
            PreparedScene(replace(scene, container=container, spreader=spreader, damages=()))
            for container, spreader in possible_shapes(self.config)
        ]
        for shape in shaped:  # what shadows and labels ask of meshes
            on_step()
            shape.prepare_shapes(damages=self.config.damage.probability > 0)
        lens = any(camera.lens is not None for camera in scene.cameras)
        with self._gpu.drawing() as renderer:
            for each in chain(lit, shaped):
                on_step()
                renderer.preload(each, lens)
            lights = {shader_lights(renderer.ambient(name).lights): name for name in names}
        # programs and targets: every way to draw, every container
        ways = list(product(damage_variant_configs(self.config), lights.values()))
        boxes = list(single_container_configs(self.config.container))
        for i in range(max(len(ways), len(boxes))):
            (config, name), box = ways[i % len(ways)], boxes[i % len(boxes)]
            shown = sample_scene(replace(config, container=box), self.seed, 0, self.environments)
            shown = replace(shown, environment=EnvironmentView(name, 0.0))
            # what a camera does not see of the damage makes no difference to how it draws
            alike = {
                (
                    camera.lens is None,
                    variant(seen_damages(shown.damages, camera.position_mm)),
                ): camera
                for camera in shown.cameras
            }
            on_step()
            for camera in alike.values():
                self.render(scene=shown, camera=camera)

    def close(self) -> None:
        """Free the renderer and its GL context; a later render opens them again."""
        self._gpu.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        return {"config": self.config, "seed": self.seed, **vars(self.settings)}

    def __setstate__(self, arguments: dict[str, Any]) -> None:
        self.__init__(**arguments)  # type: ignore[misc]

    def _chosen(
        self, index: int | None, camera: str | Camera | None, scene: Scene | None
    ) -> tuple[PreparedScene, Camera]:
        """Return the scene and camera that the arguments of a render name."""
        if (index is None) == (scene is None):
            raise ConfigError("render: give either index or scene")
        if scene is None:
            assert index is not None
            scene = self.scene(index)
        prepared = self._prepared(scene)
        if camera is None or isinstance(camera, str):
            return prepared, find_camera(scene, camera)
        return prepared, check_camera(camera, scene.container)

    def _prepared(self, scene: Scene) -> PreparedScene:
        """Return the geometry of a scene; check and prepare it once for all its cameras."""
        sampled, given = self._sampled, self._given  # another thread may replace them
        if sampled is not None and scene is sampled[1].scene:
            return sampled[1]
        if given is None or scene is not given.scene:
            self._given = given = PreparedScene(check_scene(scene))
        return given


def _load_light(hdris: Mapping[str, Path], name: str) -> EnvironmentLight:
    if name not in hdris:
        raise ConfigError(f"environment: no HDRI {name!r}{nearest(name, hdris)}")
    return load_environment(hdris[name])


def _check_lenses(config: Config, size: tuple[int, int]) -> None:
    """Refuse lenses that cannot be drawn at this size before the first image is drawn."""
    for name, rig in config.cameras.items():
        for lens in extreme_lenses(rig.lens) if rig.lens else ():
            camera = Camera(
                name, (0, 0, 0), (0, 1, 0), rig.focal_mm, 0, rig.sensor_width_mm, 0, lens
            )
            view_of(camera, size)
