"""Other ways to give a camera's focal length: a field of view, a camera matrix, a calibration file.

They are keys of a camera in a file. The configuration that is read has `focal_mm`, `pixel_aspect`,
`principal_point` and `lens` instead.
"""

import math
import numbers
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from fastgen.config.cameras import CameraConfig
from fastgen.config.yaml_values import LONGEST_FILE, loaded
from fastgen.errors import ConfigError, shown
from fastgen.files.plain_file import read_plain
from fastgen.scene.optics import PRINCIPAL_LIMITS

SENSOR_WIDTH_MM = 36.0
"""Width of the sensor if neither the file nor the base gives one."""

_MATRIX = ("fx", "fy", "cx", "cy", "width", "height")

SHORTHANDS: dict[str, dict[str, Any]] = {
    "fov_deg": {
        "type": "number",
        "exclusiveMinimum": 0,
        "exclusiveMaximum": 360,
        "description": "Horizontal field of view without distortion, instead of focal_mm. Unit: "
        "degrees.",
    },
    "matrix": {
        "type": "object",
        "properties": {name: {"type": "number"} for name in _MATRIX},
        "required": list(_MATRIX),
        "additionalProperties": False,
        "description": "OpenCV's camera matrix and the image size that it is for, in pixels, "
        "instead of focal_mm.",
    },
    "calibration": {
        "type": "string",
        "description": "Path of a calibration file of OpenCV or ROS, relative to this one, instead "
        "of focal_mm and lens.",
    },
}
"""JSON Schema of the keys that this module replaces."""

_FISHEYES = ("fisheye", "equidistant", "kannala_brandt")
_PLUMB_BOBS = ("", "plumb_bob", "brown_conrady", "radtan")
_NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "matrix": ("camera_matrix", "cameraMatrix", "camera_Matrix", "K", "k"),
    "distortion": ("distortion_coefficients", "dist_coeffs", "distCoeffs", "D", "d"),
}
"""Names of each part of a calibration in files of OpenCV and ROS."""


def with_focal_lengths(
    cameras: Mapping[Any, Any], base: Mapping[str, CameraConfig], folder: Path
) -> dict[Any, Any]:
    """Return the cameras of a file with the fields of CameraConfig only.

    Args:
        cameras: Values of each camera in the file.
        base: Cameras that they inherit from, by the same names.
        folder: Folder that paths are relative to.

    Raises:
        ConfigError: naming the camera and the key that cannot be used.
    """
    return {
        name: _plain(f"cameras.{name}", values, base.get(name), folder)
        if isinstance(values, Mapping) and set(values) & {*SHORTHANDS}
        else values
        for name, values in cameras.items()
    }


def _plain(
    path: str, values: Mapping[Any, Any], base: CameraConfig | None, folder: Path
) -> dict[Any, Any]:
    """Return the values of one camera without the shorthand that it uses."""
    given = [key for key in (*SHORTHANDS, "focal_mm") if key in values]
    if len(given) > 1:
        raise ConfigError(
            f"{path}: {' and '.join(given)} each give the focal length; remove all but one"
            + (", focal_mm for example" if "focal_mm" in given else "")
        )
    key = given[0]
    rest = {name: value for name, value in values.items() if name != key}
    sensor_mm = rest.get("sensor_width_mm", base.sensor_width_mm if base else SENSOR_WIDTH_MM)
    if not _is_number(sensor_mm):
        return {**rest, "focal_mm": 1.0}  # the error about sensor_width_mm follows
    if key == "fov_deg":
        lens = rest.get("lens", base and base.lens)
        model = lens.get("model") if isinstance(lens, Mapping) else getattr(lens, "model", "")
        return {**rest, "focal_mm": _of_view(f"{path}.{key}", values[key], sensor_mm, model)}
    if key == "matrix":
        return {**_of_matrix(f"{path}.{key}", values[key], sensor_mm, 0.5), **rest}
    if not isinstance(values[key], str):
        raise ConfigError(f"{path}.{key}: expected the path of a file, got {shown(values[key])}")
    if "lens" in rest:
        raise ConfigError(f"{path}: calibration and lens each give the lens; remove one of them")
    file = folder / values[key]
    try:
        return {**_of_file(file, sensor_mm), **rest}
    except ConfigError as error:
        raise ConfigError(f"{path}.{key}: {file}: {error}") from None


def _of_view(path: str, fov_deg: Any, sensor_mm: float, model: Any) -> float:
    """Return the focal length of a field of view."""
    widest = 360 if model == "fisheye" else 180
    if not _is_number(fov_deg) or not 0 < fov_deg < widest:
        raise ConfigError(
            f"{path}: {shown(fov_deg)} is not a field of view; give degrees between 0 and {widest}"
        )
    half = math.radians(fov_deg) / 2
    return sensor_mm / 2 / (half if model == "fisheye" else math.tan(half))


def _of_matrix(path: str, matrix: Any, sensor_mm: float, corner_px: float) -> dict[str, Any]:
    """Return the fields of a camera matrix.

    Args:
        path: Key, for messages.
        matrix: Values of _MATRIX.
        sensor_mm: Width of the sensor.
        corner_px: Distance from the origin of cx and cy to the centre of the first pixel, whose
            corner is the origin here. OpenCV's origin is that centre.
    """
    if not isinstance(matrix, Mapping) or set(matrix) != set(_MATRIX):
        given = set(matrix) if isinstance(matrix, Mapping) else set()
        lacking = [name for name in _MATRIX if name not in given]
        wrong = f"lacks {', '.join(lacking)}" if given and lacking else f"got {shown(matrix)}"
        raise ConfigError(f"{path}: {wrong}; give {', '.join(_MATRIX)}")
    for name, value in matrix.items():
        _check_pixels(f"{path}.{name}", value, positive=name not in ("cx", "cy"))
    fx, fy, cx, cy, width, height = (float(matrix[name]) for name in _MATRIX)
    for name, at, side in (("cx", cx, width), ("cy", cy, height)):
        least, most = (side / 2 + limit * width - corner_px for limit in PRINCIPAL_LIMITS)
        if not least <= at <= most:
            raise ConfigError(f"{path}.{name}: {at:g} is out of range; give {least:g} to {most:g}")
    return {
        "focal_mm": fx / width * sensor_mm,
        "pixel_aspect": fy / fx,
        "principal_point": [
            (cx + corner_px - width / 2) / width,
            (cy + corner_px - height / 2) / width,
        ],
    }


def _check_pixels(path: str, value: Any, positive: bool = True) -> None:
    """Raise ConfigError, starting with `path`, unless a value is a number of pixels."""
    if not _is_number(value) or (positive and value <= 0):
        above = " above 0" if positive else ""
        raise ConfigError(f"{path}: expected a number of pixels{above}, got {shown(value)}")


def _of_file(path: Path, sensor_mm: float) -> dict[str, Any]:
    """Return the fields of a calibration file."""
    data = _calibration(path)
    found = {
        part: next((data[name] for name in names if name in data), None)
        for part, names in _NAMES.items()
    }
    missing = [part for part in ("width", "height", "matrix") if found[part] is None]
    if missing:
        names = " or ".join(_NAMES[missing[0]])
        raise ConfigError(f"has no {missing[0]}; name it {names}")
    for part in ("width", "height"):
        _check_pixels(next(name for name in _NAMES[part] if name in data), found[part])
    entries = _numbers("camera_matrix", found["matrix"])
    if len(entries) != 9:
        raise ConfigError(f"camera_matrix has {len(entries)} numbers; give 9")
    fx, skew, cx, _, fy, cy, *_ = entries
    if skew:
        raise ConfigError(f"camera_matrix has a skew of {skew:g}; calibrate without skew")
    size = {name: found[name] for name in ("width", "height")}
    values = _of_matrix(
        "camera_matrix", {"fx": fx, "fy": fy, "cx": cx, "cy": cy, **size}, sensor_mm, 0.5
    )
    model = str(data.get("distortion_model", "fisheye" if data.get("fisheye_model") else ""))
    return {**values, "lens": _lens(model, _numbers("distortion", found["distortion"] or []))}


def _lens(model: str, numbers_given: list[float]) -> dict[str, Any] | None:
    """Return the values of LensConfig, or None without distortion."""
    if model in _FISHEYES:
        most, names = 4, "k1 k2 k3 k4"
    elif model in (*_PLUMB_BOBS, "rational_polynomial"):
        most, names = 5, "k1 k2 p1 p2 k3"
    else:
        known = ", ".join((*_FISHEYES, *_PLUMB_BOBS[1:]))
        raise ConfigError(f"distortion_model {shown(model)} is unknown (choose from {known})")
    if any(numbers_given[most:]):
        rest = (
            f"the model {model} has no more"
            if model in _FISHEYES
            else "calibrate without the rational, thin prism and tilted models"
        )
        raise ConfigError(f"has distortion coefficients beyond the first {most}; {rest}")
    kind = "fisheye" if model in _FISHEYES else "brown_conrady"
    if kind == "brown_conrady" and not any(numbers_given):
        return None
    return {"model": kind, **_ordered(names, numbers_given[:most])}


def _ordered(names: str, values: Sequence[float]) -> dict[str, float]:
    """Return coefficients by name; missing ones and the other model's are 0."""
    unused = dict.fromkeys(("k1", "k2", "k3", "k4", "p1", "p2"), 0.0)
    return {**unused, **dict(zip(names.split(), values, strict=False))}


def _calibration(path: Path) -> Mapping[str, Any]:
    """Return the content of a calibration file."""
    try:
        text = read_plain(path, LONGEST_FILE).decode("utf-8")
    except (OSError, ValueError) as error:
        words = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ConfigError(f"cannot be read ({words})") from None
    if text.startswith("<?xml"):
        raise ConfigError("is an XML file; write the calibration as .yaml or .json instead")
    # OpenCV's header and tags are not of YAML's form; OpenCV 5 has a tag for other than 2 axes
    text = re.sub(r"\A%YAML:1\.0[^\n]*\n", "", text)
    text = re.sub(r"!!opencv-(?:nd-)?matrix\b", "", text)
    try:
        data = loaded(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"not a YAML file ({error})") from None
    if not isinstance(data, Mapping):
        raise ConfigError(f"holds {shown(data)}; give a calibration of OpenCV or ROS")
    return data


def _numbers(name: str, value: Any) -> list[float]:
    """Return the numbers of a matrix in a calibration file."""
    data = value.get("data") if isinstance(value, Mapping) else value
    if not isinstance(data, Sequence) or isinstance(data, str):
        raise ConfigError(f"{name} is {shown(value)}; give numbers")
    for each in data:
        if not _is_number(each):
            raise ConfigError(f"{name} has {shown(each)} in place of a number; give a number")
    return [float(each) for each in data]


def _is_number(value: Any) -> bool:
    real = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return real and math.isfinite(value)
