"""From a rendered frame to a labelled sample: camera model, labels and post-processing."""

from dataclasses import replace

from fastgen.camera.sensor import apply_camera_model, is_needed, needs_radiance
from fastgen.classes import with_marks
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.labels.background import background_objects
from fastgen.labels.objects import label
from fastgen.labels.visibility import Shot
from fastgen.light.container_map import ContainerMap
from fastgen.light.exposure import airlight
from fastgen.postprocess import postprocessed
from fastgen.render.draw_inputs import ImageRequest
from fastgen.render.renderer import Renderer
from fastgen.sample import Sample
from fastgen.sampling.streams import stream


def with_radiance(image: ImageRequest) -> ImageRequest:
    """Return the request with `radiance` set if the camera model works on linear light."""
    weather = image.prepared.scene.weather
    return image._replace(radiance=_is_modelled(image) and needs_radiance(image.camera, weather))


def with_camera_model(frame: Frame, image: ImageRequest, renderer: Renderer) -> Frame:
    """Return a frame after weather and sensor effects; the same frame if there are none.

    Args:
        frame: The frame of `image`.
        image: A request from `with_radiance`.
        renderer: The renderer, with its context current.
    """
    if not _is_modelled(image):
        return frame
    scene, camera, view = image.prepared.scene, image.camera, image.view
    exposure = renderer.exposure(scene, camera, view.size)
    light = renderer.ambient(scene)
    air = airlight(light, scene.environment.yaw_deg, exposure.factor)
    developed = apply_camera_model(frame, view, camera, scene.weather, air, exposure, scene.ground)
    return replace(frame, image=developed)


def labelled(
    frame: Frame, image: ImageRequest, config: Config, containers: ContainerMap | None
) -> Sample:
    """Return a frame with its labels, after the function `config.postprocess`.

    Args:
        frame: The frame of `image`, from `with_camera_model`.
        image: The request.
        config: Rules of labels and markers, and the post-processing.
        containers: The containers that the environment shows, if they are known.

    Raises:
        FastgenError: The function fails.
    """
    scene, camera, view = image.prepared.scene, image.camera, image.view
    shot = Shot(frame, image.prepared, view, config)
    objects, background = label(shot), None
    if containers is not None and config.labels.background != "none":
        more, background = background_objects(shot, containers)
        objects += more
    sample = Sample(
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
        background=background,
        marker_classes=with_marks(config.markings.detection_classes),
    )
    if not config.postprocess or image.layer != "all":
        return sample
    rng = stream(scene.seed, scene.index, f"postprocess.{camera.name}")
    return postprocessed(sample, config.postprocess, rng)


def _is_modelled(image: ImageRequest) -> bool:
    return image.layer == "all" and is_needed(image.camera, image.prepared.scene.weather)
