"""Generator: the public way from (config, seed, index) to a labelled Sample."""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fastgen.bake import Atlas
from fastgen.camera import View, view_of
from fastgen.config import Config
from fastgen.cuda import CudaFrame, CudaFrames, cuda_reason
from fastgen.environment import (
    EnvironmentLight,
    bundled_hdris,
    bundled_weights,
    find_hdris,
    load_environment,
)
from fastgen.errors import ConfigError
from fastgen.gl import GLContext, open_context
from fastgen.labels import label
from fastgen.programs import LAYERS
from fastgen.records import nearest
from fastgen.renderer import Renderer
from fastgen.sample import Frame, Sample
from fastgen.sampling import sample_scene
from fastgen.scene import Camera, Scene
from fastgen.visibility import Shot

MIN_SIZE, MAX_SIZE = 64, 4096

QUALITY = {"draft": 1, "balanced": 2, "high": 3}
"""Samples along each axis of a pixel by quality."""


def find_camera(scene: Scene, name: str) -> Camera:
    """The camera of `scene` called `name`. Raises ConfigError that names the nearest one."""
    names = [camera.name for camera in scene.cameras]
    if name not in names:
        raise ConfigError(f"camera: {name!r} is unknown{nearest(name, names)}")
    return scene.camera(name)


class Generator:
    """Makes scenes and renders them. A context manager; GL is opened at the first render.

    config: the distribution. seed: whole number of 0 or more. size: (width, height) in pixels,
    64 to 4096 each. backend: auto, egl or osmesa. hdri_dir: folder of .hdr and .exr files to use
    in place of the bundled ones. quality: draft (one sample a pixel), balanced or high. Use it from
    one thread, and make one in each process.

    Raises ConfigError for a bad argument, AssetError for a bad HDRI, ContextError without OpenGL.
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
        if seed != int(seed) or seed < 0:
            raise ConfigError(f"seed: {seed!r} is not a whole number of 0 or more")
        width, height = size
        for side in size:
            if not MIN_SIZE <= side <= MAX_SIZE or side != int(side):
                raise ConfigError(
                    f"size: {width}x{height} is out of range; "
                    f"each side takes {MIN_SIZE} to {MAX_SIZE} pixels"
                )
        if quality not in QUALITY:
            raise ConfigError(f"quality: {quality!r} is unknown{nearest(quality, QUALITY)}")
        self.config = config or Config.preset()
        self.seed = int(seed)
        self.size = (int(width), int(height))
        self.backend = backend
        self._samples_per_axis = QUALITY[quality]
        self._device_index = device_index
        self._hdris = (
            {path.stem: path for path in find_hdris(Path(hdri_dir))}
            if hdri_dir
            else bundled_hdris()
        )
        self._weights = dict.fromkeys(sorted(self._hdris), 1.0) if hdri_dir else bundled_weights()
        # kept on the CPU too, for metering; the least recently used fall out
        self._light = lru_cache(maxsize=24)(self._load_light)
        self._gl: GLContext | None = None
        self._renderer: Renderer | None = None
        self._cuda: CudaFrames | None = None

    @property
    def environments(self) -> dict[str, float]:
        """Name -> weight in the draw of the HDRIs at hand, sorted; those of a folder weigh 1."""
        return dict(self._weights)

    def environment_digest(self, name: str) -> str:
        """SHA-256 in hexadecimal of an HDRI's file."""
        return hashlib.sha256(self._hdris[name].read_bytes()).hexdigest()

    @property
    def renderer_name(self) -> str:
        """The driver's name for what renders, such as 'llvmpipe (LLVM 15.0.6, 256 bits)'."""
        self._open()
        assert self._gl is not None
        return self._gl.renderer

    @property
    def used_backend(self) -> str:
        """Which backend 'auto' came to: egl or osmesa."""
        self._open()
        assert self._gl is not None
        return self._gl.backend

    def scene(self, index: int) -> Scene:
        """Scene number `index`: plain data, no GL needed, the same on every machine."""
        if index != int(index) or index < 0:
            raise ConfigError(f"index: {index!r} is not a whole number of 0 or more")
        return sample_scene(self.config, self.seed, int(index), self.environments)

    def render(
        self,
        index: int | None = None,
        camera: str | Camera = "A",
        scene: Scene | None = None,
        layer: str = "all",
        normals: bool = False,
    ) -> Sample:
        """One labelled image of scene `index`, or of `scene` when that is given.

        camera: the name of one of the scene's cameras, or a Camera of your own.
        layer: 'all', or one material layer by itself (see programs.LAYERS). normals: give
        Sample.normals too, which costs another draw.
        """
        if layer not in LAYERS:
            raise ConfigError(f"layer: {layer!r} is unknown{nearest(layer, LAYERS)}")
        scene, camera = self._chosen(index, camera, scene)
        renderer = self._open()
        frame = renderer.render(scene, camera, self.size, layer)
        view = view_of(camera, self.size)
        mesh, spreader = renderer.mesh(scene.container), renderer.spreader_mesh(scene)
        objects = label(Shot(frame, scene, view, mesh, spreader, self.config))
        return Sample(
            image=frame.image,
            ids=frame.ids,
            damage=frame.damage,
            depth=frame.depth,
            scene=scene,
            camera=camera,
            view=view,
            objects=objects,
            normals=self._normals(frame, scene, camera, view) if normals else None,
        )

    def _normals(
        self, frame: Frame, scene: Scene, camera: Camera, view: View
    ) -> NDArray[np.float32]:
        """From the layer that shows them, where 0..255 stands for -1..1 along the world's axes."""
        shown = self._open().render(scene, camera, self.size, "normals").image
        world = shown.astype(np.float32) / 127.5 - 1
        normals = (world @ view.rotation.T.astype(np.float32)).astype(np.float32)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
        normals[frame.ids == 0] = 0
        return normals

    def render_cuda(
        self,
        index: int | None = None,
        camera: str | Camera = "A",
        scene: Scene | None = None,
    ) -> CudaFrame:
        """As `render`, but the frame stays on the GPU, without objects; good until the next call.

        Raises ContextError where `cuda_reason` gives one.
        """
        scene, camera = self._chosen(index, camera, scene)
        renderer = self._open()
        if self._cuda is None:
            assert self._gl is not None
            self._cuda = CudaFrames(self._gl, self.size)
        image, labels, depth = self._cuda.take(renderer.draw(scene, camera, self.size))
        return CudaFrame(image, labels, depth, scene, camera, view_of(camera, self.size))

    def cuda_reason(self) -> str:
        """Why `render_cuda` cannot work here, in one line; '' where it can."""
        self._open()
        assert self._gl is not None
        return cuda_reason(self._gl)

    def bake(self, scene: Scene, texel_mm: float = 4.0) -> Atlas:
        """All material layers of a scene's container as textures; texel_mm: width of a texel.

        Raises ConfigError for a texel so small that the atlas would pass bake.MAX_ATLAS.
        """
        return self._open().bake(scene, texel_mm)

    def bake_spreader(self, scene: Scene, texel_mm: float = 4.0) -> Atlas | None:
        """As `bake`, of the spreader; None where the scene has none."""
        return self._open().bake_spreader(scene, texel_mm)

    def exposure(self, scene: Scene, camera: Camera) -> float:
        """Factor on linear radiance, ahead of the tone curve, with which `camera` takes `scene`."""
        return self._open().exposure(scene, camera, self.size)

    def preload(self) -> None:
        """Load every light that scenes draw, so that neither time nor memory grows later."""
        renderer = self._open()
        drawn = [name for name, weight in self._weights.items() if weight > 0]
        for name in self.config.environment.names or drawn:
            renderer.preload(name)

    def close(self) -> None:
        """Free the renderer and its GL context; a later render opens them again."""
        if self._cuda is not None:
            self._cuda.release()
        if self._renderer is not None:
            self._renderer.release()
        if self._gl is not None:
            self._gl.release()
        self._cuda, self._renderer, self._gl = None, None, None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _chosen(
        self, index: int | None, camera: str | Camera, scene: Scene | None
    ) -> tuple[Scene, Camera]:
        """The scene and camera that the arguments of a render name."""
        if (index is None) == (scene is None):
            raise ConfigError("render: give either index or scene")
        if scene is None:
            assert index is not None
            scene = self.scene(index)
        return scene, find_camera(scene, camera) if isinstance(camera, str) else camera

    def _open(self) -> Renderer:
        if self._renderer is None:
            self._gl = open_context(self.backend, self._device_index)
            threshold_mm = self.config.damage.mask_threshold_mm
            self._renderer = Renderer(self._gl, self._light, self._samples_per_axis, threshold_mm)
        else:
            assert self._gl is not None
            self._gl.make_current()  # another generator may have been at work in between
        return self._renderer

    def _load_light(self, name: str) -> EnvironmentLight:
        if name not in self._hdris:
            raise ConfigError(f"environment: no HDRI {name!r}{nearest(name, self._hdris)}")
        return load_environment(self._hdris[name])
