"""Generator: the public way from (config, seed, index) to a labelled Sample."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Self

from fastgen.batch import items_of
from fastgen.camera.projection import view_of
from fastgen.config.config import Config, LabelConfig
from fastgen.decals.own_art import images_of
from fastgen.decals.own_fonts import OwnPrints
from fastgen.errors import ConfigError, nearest
from fastgen.finishing import labelled, with_camera_model, with_radiance
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.container_map import ContainerMap, container_map_path, load_container_map
from fastgen.light.environment import EnvironmentLight, load_environment
from fastgen.light.hdri import bundled_hdris, bundled_weights, content_hash, hdris_by_name
from fastgen.postprocess import imported
from fastgen.preload import preload
from fastgen.render.batch_readback import chunks
from fastgen.render.cuda import CudaFrame, cuda_reason
from fastgen.render.draw_inputs import ImageRequest
from fastgen.render.gl import open_context
from fastgen.render.passes.bake import Atlas
from fastgen.render.renderer import Renderer
from fastgen.render.session import GpuSession
from fastgen.render.settings import QUALITY, RenderSettings
from fastgen.render.variant import LAYERS
from fastgen.sample import Sample
from fastgen.sampling.lens_check import check_lenses
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Camera, Scene
from fastgen.scene.check import OwnDecals, check_camera, check_scene
from fastgen.validation import check_fields, check_known, whole


def find_camera(scene: Scene, name: str | None = None) -> Camera:
    """Return a camera of a scene by its name, or the first one without a name.

    Raises:
        ConfigError: The scene has no such camera; the message names the nearest one.
    """
    names = [camera.name for camera in scene.cameras]
    if not names:
        raise ConfigError("camera: the scene has none; give a Camera")
    if name is None:
        return scene.cameras[0]
    check_known("camera", name, names)
    return scene.camera(name)


class Generator:
    """Samples scenes and renders them with labels.

    A context manager; the GL context opens at the first render. Threads may share a generator and
    draw in turn. A process that is forked off, or that receives a pickled generator, opens its own
    context. If a generator is dropped without `close`, its GL objects are freed when the next
    generator of this process opens its context.

    Attributes:
        config: Distribution of the scenes.
        seed: Seed of the scenes.
        settings: Size, quality, backend, device and HDRI folder.
        gpu: Access to the GL context and the renderer.
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
        """Check the arguments; nothing is rendered yet.

        Args:
            config: Distribution of the scenes, by default the preset "seafront".
            seed: Whole number of 0 or more.
            size: (width, height) in pixels. RenderSettings describes it and the arguments below.
            backend: "auto", "egl" or "osmesa".
            hdri_dir: Folder of HDRIs that replaces the bundled ones.
            quality: "draft", "balanced", "fine" or "high".
            device_index: EGL device, numbered as by `fastgen doctor`.

        Raises:
            ConfigError: An argument is not valid, or "high" is chosen without Embree.
            AssetError: An HDRI cannot be read.
        """
        self.config = Config.checked(config)
        self.seed = whole("seed", seed)
        self.settings = RenderSettings(size, quality, backend, device_index, hdri_dir)
        check_lenses(self.config, self.settings.size)
        self._hdris = bundled_hdris() if hdri_dir is None else hdris_by_name(hdri_dir)
        self._weights = (
            bundled_weights() if hdri_dir is None else dict.fromkeys(sorted(self._hdris), 1.0)
        )
        if self.config.postprocess:
            imported(self.config.postprocess)  # refuses an unusable one at once
        # the cameras of a scene are usually rendered one after the other
        self._sampled: tuple[tuple[Config, int, int], PreparedScene] | None = None
        self._given: tuple[tuple[Scene, PreparedScene], ...] = ()
        markings = self.config.markings
        own = OwnPrints(
            images_of(markings.own_art),
            tuple(chain.from_iterable(markings.read_fonts().values())),
        )
        self._own_decals = OwnDecals(
            markings.detection_classes, tuple(own.art), tuple(each.font.name for each in own.fonts)
        )
        self.gpu = GpuSession(
            partial(open_context, self.settings.backend, self.settings.device_index),
            partial(
                Renderer,
                light=partial(_load_light, self._hdris),
                quality=QUALITY[quality],
                damage=self.config.damage,
                own=own,
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
        """Weight of each available HDRI in the draw, by name; 1 for the HDRIs of a folder."""
        return dict(self._weights)

    @property
    def environment_record(self) -> dict[str, dict[str, Any]]:
        """SHA-256 and weight of each available HDRI by name, which decide the light of scenes.

        For an HDRI with a container map, `containers` is the SHA-256 of the map.
        """
        record: dict[str, dict[str, Any]] = {}
        for name, weight in self._weights.items():
            path = self._hdris[name]
            record[name] = {"sha256": content_hash(path), "weight": weight}
            if container_map_path(path).exists():
                record[name]["containers"] = content_hash(container_map_path(path))
        return record

    def container_map(self, environment: str) -> ContainerMap | None:
        """Return the containers that an environment shows; None if they are unknown."""
        path = self._hdris.get(environment)
        return None if path is None else load_container_map(path)

    @property
    def renderer_name(self) -> str:
        """Renderer string of the GL driver, such as 'llvmpipe (LLVM 15.0.6, 256 bits)'."""
        with self.gpu.drawing():
            return self.gpu.context().renderer

    @property
    def used_backend(self) -> str:
        """Backend in use, "egl" or "osmesa"; "auto" resolves to one of them."""
        with self.gpu.drawing():
            return self.gpu.context().backend

    def scene(self, index: int) -> Scene:
        """Return scene number `index`: plain data, equal on every machine. Needs no GL."""
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
        """Render one labelled image.

        Args:
            index: Number of the scene to sample and render. Give either this or `scene`.
            camera: Name of one of the scene's cameras, or a Camera; by default the first camera.
            scene: Scene to render.
            layer: "all", or one of LAYERS to see a single material layer unlit.
            normals: Fill `Sample.normals`.
            labels: Replaces `config.labels`, which says which objects are marked ignored.

        Raises:
            ConfigError: An argument is not valid or the scene cannot be drawn.
            ContextError: There is no OpenGL.
            FastgenError: The function `config.postprocess` fails.
        """
        config = self._labelling(labels)
        check_known("layer", layer, LAYERS)
        prepared, camera = self._chosen(index, camera, scene)
        image = self._request(prepared, camera, layer, normals)
        return self._rendered([image], config)[0]

    def render_batch(
        self,
        indices: Iterable[int] | None = None,
        cameras: Iterable[str | Camera | None] | str | Camera | None = None,
        scenes: Iterable[Scene] | None = None,
        layer: str = "all",
        normals: bool = False,
        labels: LabelConfig | None = None,
    ) -> list[Sample]:
        """Render several labelled images, equal to those of `render`.

        Each scene is prepared once, even if other images come between its own. Images are drawn
        one after the other. On a GPU, the CPU waits once for up to 16 images instead of once for
        each image, except with `normals` and in the quality "high", whose passes wait for each.

        Args:
            indices: Number of the scene of each image; numbers may repeat. Give either this or
                `scenes`.
            cameras: Camera of each image, a name or a Camera; or one for all images. By default,
                and for None, it is the first camera of the scene.
            scenes: Scene of each image.
            layer: As for `render`, for all images.
            normals: As for `render`, for all images.
            labels: As for `render`, for all images.

        Returns:
            The samples in the order of the arguments, about 5 MB each at 640x640.

        Raises:
            ConfigError: An argument is not valid or a scene cannot be drawn. Nothing is drawn if
                the message begins with the position of an image, as in "image 2 of the batch".
            ContextError: There is no OpenGL.
            FastgenError: The function `config.postprocess` fails.
        """
        config = self._labelling(labels)
        check_known("layer", layer, LAYERS)
        items, images = items_of(indices, cameras, scenes), []
        for item in items:
            try:
                chosen = self._chosen(item.index, item.camera, item.scene)
                images.append(self._request(*chosen, layer, normals))
            except ConfigError as error:
                raise ConfigError(f"image {item.number} of the batch: {error}") from None
        samples = zip(items, self._rendered(images, config), strict=True)
        found = {item.number: sample for item, sample in samples}
        return [found[number] for number in range(len(items))]

    def render_cuda(
        self,
        index: int | None = None,
        camera: str | Camera | None = None,
        scene: Scene | None = None,
    ) -> CudaFrame:
        """Render one frame into CUDA memory, without objects. The next call overwrites it.

        Sensor effects, rain and the veil of fog are computed on the CPU and therefore missing here.

        Raises:
            ConfigError: An argument is not valid or the scene cannot be drawn.
            ContextError: CUDA cannot take the frame, see `cuda_reason`.
        """
        prepared, camera = self._chosen(index, camera, scene)
        with self.gpu.drawing() as renderer:
            frames = self.gpu.frames(self.size)
            image, labels, depth = frames.take(renderer.draw(prepared, camera, self.size))
        return CudaFrame(image, labels, depth, prepared.scene, camera, view_of(camera, self.size))

    def cuda_reason(self) -> str:
        """Return in one line why `render_cuda` cannot work here; "" if it can."""
        with self.gpu.drawing():
            return cuda_reason(self.gpu.context())

    def bake(self, scene: Scene, texel_mm: float = 4.0) -> Atlas:
        """Bake the material layers of a scene's container into textures.

        Args:
            scene: The scene; damage is included except for the cut of holes.
            texel_mm: Width of a texel on the sheet.

        Raises:
            ConfigError: The texel is too small for the largest atlas, or the scene is not valid.
        """
        with self.gpu.drawing() as renderer:
            return renderer.bake(self._prepared(scene), texel_mm)

    def bake_spreader(self, scene: Scene, texel_mm: float = 4.0) -> Atlas | None:
        """Bake the material layers of a scene's spreader; None if it has none. See `bake`."""
        with self.gpu.drawing() as renderer:
            return renderer.bake_spreader(self._prepared(scene), texel_mm)

    def bake_ground(self, scene: Scene, texel_mm: float = 4.0) -> Atlas | None:
        """Bake the ground of a scene within its reach; None if it has none.

        The texels are wider than `texel_mm` if the texture would have more than 4096 along a side.
        """
        with self.gpu.drawing() as renderer:
            return renderer.bake_ground(self._prepared(scene), texel_mm)

    def exposure(self, scene: Scene, camera: str | Camera) -> float:
        """Return the factor on linear radiance that a camera applies before the tone curve."""
        prepared, chosen = self._chosen(None, camera, scene)
        with self.gpu.drawing() as renderer:
            return renderer.exposure(prepared.scene, chosen, self.size).factor

    def checked(self, scene: Scene) -> Scene:
        """Return a copy of a scene that this generator can draw, see `check_scene`.

        Raises:
            ConfigError: naming the first part that cannot be drawn.
        """
        return check_scene(scene, self._own_decals)

    def preload(self, on_step: Callable[[], None] = lambda: None) -> None:
        """Prepare every light, shape and program that scenes may need.

        Afterwards neither the time nor the memory of a render grows.

        Args:
            on_step: Called before each step; a step takes seconds the first time.
        """
        preload(self, on_step)

    def close(self) -> None:
        """Free the renderer and its GL context. A later render opens them again."""
        self.gpu.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        return {"config": self.config, "seed": self.seed, **vars(self.settings)}

    def __setstate__(self, arguments: dict[str, Any]) -> None:
        self.__init__(**arguments)  # type: ignore[misc]

    def _labelling(self, labels: LabelConfig | None) -> Config:
        """Return the configuration with other rules of labels, if there are any."""
        if labels is None:
            return self.config
        return replace(self.config, labels=check_fields(labels, LabelConfig, "labels"))

    def _request(
        self, prepared: PreparedScene, camera: Camera, layer: str, normals: bool
    ) -> ImageRequest:
        view = view_of(camera, self.size)
        return with_radiance(ImageRequest(prepared, camera, view, layer, normals=normals))

    def _rendered(self, images: list[ImageRequest], config: Config) -> list[Sample]:
        """Render images and label them by the rules of a configuration; empties the list."""
        samples: list[Sample] = []
        waiting = chunks(images)[::-1]
        images.clear()  # a scene's geometry is dropped after its last image
        while waiting:
            chunk = waiting.pop()
            with self.gpu.drawing() as renderer:
                drawn = zip(renderer.render_batch(chunk), chunk, strict=True)
                frames = [with_camera_model(frame, image, renderer) for frame, image in drawn]
            for frame, image in zip(frames, chunk, strict=True):
                containers = self.container_map(image.prepared.scene.environment.name)
                samples.append(labelled(frame, image, config, containers))
        return samples

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
            return prepared, find_camera(prepared.scene, camera)
        return prepared, check_camera(camera, prepared.scene)

    def _prepared(self, scene: Scene) -> PreparedScene:
        """Return the geometry of a scene; check and prepare it once for all its cameras.

        The last two scenes are kept: damaged and undamaged ones may alternate.
        """
        sampled, given = self._sampled, self._given  # another thread may replace them
        if sampled is not None and scene is sampled[1].scene:
            return sampled[1]
        for known, prepared in given:
            if scene is known:
                return prepared
        prepared = PreparedScene(self.checked(scene))
        self._given = ((scene, prepared), *given[:1])
        return prepared


def _load_light(hdris: Mapping[str, Path], name: str) -> EnvironmentLight:
    if name not in hdris:
        raise ConfigError(f"environment: no HDRI {name!r}{nearest(name, hdris)}")
    light, containers = load_environment(hdris[name]), load_container_map(hdris[name])
    return light if containers is None else replace(light, obstacles=containers.obstacles)
