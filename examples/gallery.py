"""Pictures of scenes with many settings, for docs/gallery.md: docs/gallery/NAME.jpg.

python examples/gallery.py [presets light ...]
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from captioned import beside, captioned, write_jpeg

from fastgen import Config, Generator
from fastgen.scene import Camera, Scene

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "gallery"
WIDTH_PX = 1280
QUALITY = 82
"""Quality of the JPEG files."""

_CLEAN = {
    "rust_coverage": 0,
    "dirt_strength": 0,
    "dirt_streaks": 0,
    "ageing_strength": 0,
    "bleach": 0,
    "scrapes": 0,
    "scratch_coverage": 0,
}
_CLEAR = {
    "environment": {"names": ["port_afternoon"], "weights": {}},
    "weather": {"fog_probability": 0, "rain_probability": 0, "wet_probability": 0},
    "sensor": {"stamp": {"probability": 0}, "defocus": {"probability": 0}},
}
_WET_PAVING = {"kinds": {"paving": 1.0}, "wet_probability": 1.0, "wetness": [1.0, 1.0]}
_PLAIN = {
    "surface": {"rust_coverage": [0.0, 0.02]},
    "environment": {"names": ["port_overcast"]},
    "markings": {"marked_containers": 0.0},
}


@dataclass(frozen=True)
class Tile:
    """One picture with its caption.

    Attributes:
        caption: Text below the picture.
        preset: Preset of the configuration.
        camera: Camera of the preset.
        seed: Seed of the scene.
        index: Index of the scene.
        changes: Changed values of the configuration, nested by section.
        quality: Quality preset of the renderer.
        near: Show the only damage of the scene from 1.8 m away, not the camera's view.
    """

    caption: str
    preset: str
    camera: str
    seed: int
    index: int
    changes: dict[str, Any] = field(default_factory=dict)
    quality: str = "fine"
    near: bool = False

    @property
    def config(self) -> Config:
        """The configuration of the scene."""
        return Config.from_values(self.changes, Config.preset(self.preset))


@dataclass(frozen=True)
class Section:
    """A picture of several tiles.

    Attributes:
        tiles: The tiles in reading order.
        columns: Tiles in a row.
        aspect: Height of a tile divided by its width.
        zoom: Show the middle 1 / zoom of each tile, enlarged without smoothing.
    """

    tiles: Sequence[Tile]
    columns: int = 3
    aspect: float = 0.75
    zoom: int = 1


def _damage(caption: str, kind: str, index: int, **values: Any) -> Tile:
    damage = {"probability": 1.0, "count": [1, 1], "kinds": [kind], "faces": ["front"]}
    changes = {
        **_PLAIN,
        "spreader": {"probability": 0},
        "damage": {**damage, **({kind: values} if values else {})},
    }
    return Tile(caption, "seafront", "A", 5, index, changes, near=True)


def _light(caption: str, name: str, **weather: Any) -> Tile:
    clear = {"fog_probability": 0, "rain_probability": 0, "wet_probability": 0}
    environment = {"names": [name], "weights": {}, "yaw_deg": 120}
    changes = {
        "environment": environment,
        "weather": {**clear, **weather},
        "ground": {"wet_probability": 0},
        "sensor": {"stamp": {"probability": 0}},
    }
    return Tile(caption, "gate", "rear", 3, 4, changes)


def _surface(caption: str, **values: Any) -> Tile:
    changes = {**_PLAIN, "surface": {**_CLEAN, "colors": {"blue": "#1f4e84"}, **values}}
    return Tile(caption, "seafront", "Cr", 7, 17, changes)


def _arranged(name: str, index: int, **changes: Any) -> Tile:
    values = {
        "placement": {"arrangements": {name: 1.0}, "neighbours": [6, 9], "islands": 1.0},
        **_CLEAR,
        **changes,
    }
    if name == "twin":
        values["container"] = {"kinds": {"20": 1.0}}
    return Tile(name, "quay", "waterside", 4, index, values)


SECTIONS = {
    "presets": Section(
        (
            Tile("seafront, camera A", "seafront", "A", 7, 2),
            Tile("crane, camera B", "crane", "B", 7, 2),
            Tile("gate, camera rear", "gate", "rear", 3, 1),
            Tile("gate, camera left", "gate", "left", 3, 6),
            Tile("yard, camera stacker", "yard", "stacker", 3, 4, _CLEAR),
            Tile("quay, camera waterside", "quay", "waterside", 3, 3),
        )
    ),
    "qualities": Section(
        tuple(
            Tile(name, "seafront", "Cr", 7, 17, _PLAIN, quality=name)
            for name in ("draft", "balanced", "fine", "high")
        ),
        columns=4,
        aspect=1.0,
        zoom=3,
    ),
    "damage": Section(
        (
            _damage("axis: a pushed-in edge", "axis", 9, kinked=0.0),
            _damage("axis: a tilted casting", "axis", 12, kinked_posts=1.0, tilted_castings=1.0),
            _damage("concave: a folded wall", "concave", 1, outward=0.0, buckled=0.0, creased=1.0),
            _damage("concave: buckled ribs", "concave", 1, outward=0.0, buckled=1.0),
            _damage("dented: a fold", "dented", 2, marks={"probability": 0.0}),
            _damage("dented: crush marks", "dented", 11, marks={"probability": 1.0}),
            _damage("perforation: a torn hole", "perforation", 5),
            _damage("scrape", "scrape", 6),
            _damage("rust_through: pits and holes", "rust_through", 3),
            _damage("missing_paint: flaked off", "missing_paint", 9),
            _damage("graffiti: a sprayed tag", "graffiti", 11),
            _damage("door_gear: a bent bar", "door_gear", 13, gasket=0, missing=0, open=0),
            _damage("door_gear: an open handle", "door_gear", 11, gasket=0, missing=0, open=1),
            _damage("door_gear: a hanging gasket", "door_gear", 2, gasket=1.0),
        )
    ),
    "light": Section(
        (
            _light("port_noon", "port_noon"),
            _light("port_overcast", "port_overcast"),
            _light("port_golden", "port_golden"),
            _light("port_dusk", "port_dusk"),
            _light("port_blue_hour", "port_blue_hour"),
            _light("port_night", "port_night"),
            _light("fog", "port_overcast", fog_probability=1.0, visibility_mm=20000),
            _light("rain", "port_overcast", rain_probability=1.0, rate_mm_h=50),
            _light("wet", "port_overcast", wet_probability=1.0, wetness=1.0),
        )
    ),
    "surface": Section(
        (
            _surface("all of them 0"),
            _surface("rust_coverage 0.25", rust_coverage=0.25),
            _surface("dirt, dirt_streaks 1", dirt_strength=1.0, dirt_streaks=1.0),
            _surface("ageing_strength 1", ageing_strength=1.0),
            _surface("bleach 1", bleach=1.0),
            _surface("scrapes 1, scratches", scrapes=1.0, scratch_coverage=0.05),
        ),
        aspect=1.0,
    ),
    "cameras": Section(
        (
            Tile("seafront A: front", "seafront", "A", 7, 3, _CLEAR),
            Tile("seafront Cl: no_door", "seafront", "Cl", 7, 3, _CLEAR),
            Tile("seafront Cr: door", "seafront", "Cr", 7, 3, _CLEAR),
            Tile("gate front: no_door", "gate", "front", 3, 2, _CLEAR),
            Tile("gate right: back", "gate", "right", 3, 2, _CLEAR),
            Tile("gate roof: roof", "gate", "roof", 3, 2, _CLEAR),
            Tile("yard pole_door: door", "yard", "pole_door", 3, 4, _CLEAR),
            Tile("yard mast: roof", "yard", "mast", 3, 4, _CLEAR),
            Tile("quay end_left: door", "quay", "end_left", 3, 4, _CLEAR),
        )
    ),
    "surroundings": Section(
        (
            _arranged("alone", 1),
            _arranged("lifted", 1),
            _arranged("standing", 1),
            _arranged("row", 1),
            _arranged("stack", 1),
            _arranged("trailer", 1),
            _arranged("wagon", 1),
            _arranged("twin", 1),
            Tile("gate, wet paving", "gate", "rear", 3, 2, {**_CLEAR, "ground": _WET_PAVING}),
        )
    ),
}


def near_damage(scene: Scene, camera: Camera) -> Camera:
    """Return a camera 1.8 m in front of the scene's damage that looks at it from one side."""
    (damage,) = scene.damages
    target = np.array(damage.origin_mm)
    # a bar that bows outward shows it only from beside, not from above
    aside = np.array(damage.across if abs(damage.along[2]) > 0.9 else damage.along)
    away = np.array([0.0, 0.0, 0.2]) - 0.85 * np.array(damage.inward)
    position = target + 1800.0 * (away + 0.45 * aside)
    return replace(
        camera,
        position_mm=tuple(position.tolist()),
        target_mm=tuple(target.tolist()),
        focal_mm=32.0,
        roll_deg=0.0,
    )


def tiles(section: Section) -> Iterator[np.ndarray]:
    """Yield the captioned tiles of a section, uint8 [H, W, 3]."""
    width = WIDTH_PX // section.columns
    size = (width, round(width * section.aspect))
    for tile in section.tiles:
        with Generator(tile.config, seed=tile.seed, size=size, quality=tile.quality) as generator:
            scene = generator.scene(tile.index)
            camera = scene.camera(tile.camera)
            if tile.near:
                camera = near_damage(scene, camera)
            image = generator.render(scene=scene, camera=camera).image
        if section.zoom > 1:
            w, h = (side // section.zoom for side in size)
            x, y = (size[0] - w) // 2, (size[1] - h) // 2
            part = image[y : y + h, x : x + w]
            image = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_NEAREST), np.uint8)
        yield captioned(image, tile.caption)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(SECTIONS)}; default all")
    parser.add_argument("--out", type=Path, default=FOLDER)
    options = parser.parse_args()
    for name in options.names or SECTIONS:
        if name not in SECTIONS:
            parser.error(f"{name}: unknown picture; use {', '.join(SECTIONS)}")
        section = SECTIONS[name]
        picture = beside(list(tiles(section)), section.columns)
        path = options.out / f"{name}.jpg"
        write_jpeg(path, picture, QUALITY)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} KB", flush=True)


if __name__ == "__main__":
    main()
