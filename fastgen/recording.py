"""Export of a scene as a recording for the Rerun viewer: meshes, cameras, images, depth and boxes.

Lengths are in metres, in the frame of scenes: z is up. The viewer knows pinholes only, so images of
lenses with distortion do not fit the meshes near their borders.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from fastgen.errors import ConfigError
from fastgen.export import TO_Z_UP, to_trimesh
from fastgen.files.images import check_folder, png, write
from fastgen.generator import Generator
from fastgen.overlay import class_color
from fastgen.sample import Sample
from fastgen.scene import Camera, Scene
from fastgen.scene.check import check_camera


def export_rerun(
    generator: Generator,
    scene: Scene,
    path: str | Path,
    cameras: Iterable[Camera] | None = None,
    texel_mm: float = 8.0,
) -> None:
    """Write `scene` as an .rrd file, which `rerun FILE.rrd` shows.

    The meshes are at world/scene/NAME. Each camera is at world/cameras/NAME, with its image, depth
    in metres (0 for the panorama) and boxes of visible objects below.

    Args:
        generator: Renders the images and bakes the textures.
        scene: The scene.
        path: The .rrd file.
        cameras: Cameras to write; by default all cameras of the scene.
        texel_mm: Width of a texel of the containers' textures, in millimetres.

    Raises:
        ConfigError: rerun-sdk is not installed, the texel is too small, or the scene cannot be
            drawn or has no container.
        OutputError: The file cannot be written.
    """
    try:
        import rerun as rr
    except ImportError:
        raise ConfigError(
            f"{path}: recordings need rerun-sdk: pip install 'fastgen[rerun]'"
        ) from None
    scene, path = generator.checked(scene), Path(path)
    chosen = [check_camera(each, scene) for each in (scene.cameras if cameras is None else cameras)]
    check_folder(path)
    name = f"fastgen seed {scene.seed} index {scene.index}"
    recording = rr.RecordingStream("fastgen", recording_id=name, send_properties=False)
    stream = rr.binary_stream(recording)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_meshes(recording, generator, scene, texel_mm)
    for camera in chosen:
        _log_view(recording, generator.render(scene=scene, camera=camera))
    content = stream.read()
    assert content is not None
    write(path, content)


def _log_meshes(recording: Any, generator: Generator, scene: Scene, texel_mm: float) -> None:
    import rerun as rr

    made = to_trimesh(generator, scene, texel_mm)
    for node in made.graph.nodes_geometry:
        pose, name = made.graph[node]
        part = made.geometry[name]
        material, uv = part.visual.material, part.visual.uv
        texture = material.baseColorTexture
        turned = TO_Z_UP @ pose[:3, :3]
        look: dict[str, Any] = {"albedo_factor": material.baseColorFactor}
        if texture is not None:
            # rows of textures run down here, and v up in trimesh
            flipped = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=-1)
            look = {"albedo_texture": np.asarray(texture), "vertex_texcoords": flipped}
        mesh = rr.Mesh3D(
            vertex_positions=part.vertices @ turned.T + TO_Z_UP @ pose[:3, 3],
            triangle_indices=part.faces,
            vertex_normals=part.vertex_normals @ turned.T,
            **look,
        )
        recording.log(f"world/scene/{name}", mesh, static=True)


def _log_view(recording: Any, sample: Sample) -> None:
    import rerun as rr

    view, place = sample.view, f"world/cameras/{sample.camera.name}"
    pose = rr.Transform3D(translation=view.position_m, mat3x3=view.rotation.T)
    width, height = view.size
    lens = rr.Pinhole(
        image_from_camera=view.intrinsics,
        width=width,
        height=height,
        camera_xyz=rr.ViewCoordinates.RDF,
    )
    recording.log(place, pose, lens, static=True)
    image = rr.EncodedImage(contents=png(sample.image), media_type="image/png")
    recording.log(f"{place}/image", image, static=True)
    depth = np.where(np.isinf(sample.depth), 0, sample.depth)
    recording.log(f"{place}/depth", rr.DepthImage(depth, meter=1.0), static=True)
    seen = [item for item in sample.objects if item.bbox is not None and not item.background]
    boxes = rr.Boxes2D(
        array=np.array([item.bbox for item in seen], np.float32).reshape(-1, 4),
        array_format=rr.Box2DFormat.XYXY,
        labels=[f"{item.class_name} {item.text}".rstrip() for item in seen],
        colors=[class_color(item.class_name) for item in seen],
    )
    recording.log(f"{place}/boxes", boxes, static=True)
