"""Materials of the port, by name. Colours are linear Rec. 709 albedo."""

from collections.abc import Callable
from typing import Any

import bpy

Nodes = Any

PLAIN = {  # name: (albedo, roughness, metallic)
    "steel": ((0.32, 0.32, 0.33), 0.45, 0.8),
    "dark": ((0.035, 0.036, 0.038), 0.6, 0.0),
    "rubber": ((0.018, 0.018, 0.018), 0.8, 0.0),
    "glass": ((0.02, 0.03, 0.035), 0.06, 0.0),
    "white": ((0.70, 0.70, 0.68), 0.5, 0.0),
    "livery": ((0.62, 0.62, 0.60), 0.55, 0.0),
    "yellow": ((0.62, 0.36, 0.02), 0.5, 0.0),
    "red": ((0.40, 0.035, 0.025), 0.55, 0.0),
    "boot": ((0.20, 0.035, 0.028), 0.7, 0.0),
    "galvanized": ((0.36, 0.37, 0.38), 0.5, 0.5),
    "rock": ((0.16, 0.15, 0.14), 0.95, 0.0),
    "city": ((0.30, 0.30, 0.31), 0.8, 0.0),
}


def _material(name: str) -> tuple[Callable[..., Nodes], Callable[[str, Any], None]]:
    """Create a material; return functions that add a node and that set an input of its shader.

    Node sockets given as values are linked.
    """
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.cycles.emission_sampling = "NONE"
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]

    def node(kind: str, inputs: dict[Any, Any] | None = None, **settings: Any) -> Nodes:
        made = tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            setattr(made, key, value)
        for key, value in (inputs or {}).items():
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, made.inputs[key])
            else:
                made.inputs[key].default_value = value
        return made

    def set_(key: str, value: Any) -> None:
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, shader.inputs[key])
        else:
            shader.inputs[key].default_value = value

    return node, set_


def _mix(node: Any, factor: Any, a: Any, b: Any, blend: str = "MIX") -> Any:
    made = node("Mix", data_type="RGBA", blend_type=blend)
    tree = made.id_data
    for socket, value in ((made.inputs[0], factor), (made.inputs[6], a), (made.inputs[7], b)):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = (*value, 1.0) if isinstance(value, tuple) else value
    return made.outputs[2]


def _noise(node: Any, where: Any, scale: float, detail: float = 2.0) -> Any:
    return node("TexNoise", {"Vector": where, "Scale": scale, "Detail": detail}).outputs[0]


def _ramp(node: Any, value: Any, low: float, high: float) -> Any:
    return node("MapRange", {"Value": value, 1: low, 2: high}).outputs[0]


def _plain() -> None:
    for name, (albedo, roughness, metallic) in PLAIN.items():
        _, set_ = _material(name)
        set_("Base Color", (*albedo, 1.0))
        set_("Roughness", roughness)
        set_("Metallic", metallic)


def _painted(name: str, dirt: float, scale: float) -> None:
    """Paint in the object's own colour, with blotches, vertical streaks, and dust on top."""
    node, set_ = _material(name)
    info = node("ObjectInfo")
    where = node("TexCoord").outputs["Object"]
    moved = node("VectorMath", {0: where, 1: info.outputs["Location"]}, operation="ADD").outputs[0]
    streak = node("Mapping", {"Vector": moved, "Scale": (1.0, 1.0, 0.12)}).outputs[0]
    blotch = _ramp(node, _noise(node, moved, scale), 0.45, 0.75)
    run = _ramp(node, _noise(node, streak, 4 * scale), 0.5, 0.8)
    color = _mix(
        node,
        node("Math", {0: blotch, 1: dirt}, operation="MULTIPLY").outputs[0],
        info.outputs["Color"],
        (0.16, 0.13, 0.10),
    )
    rust = node("Math", {0: run, 1: 0.7 * dirt}, operation="MULTIPLY").outputs[0]
    color = _mix(node, rust, color, (0.12, 0.05, 0.025))
    normal = node("SeparateXYZ", {0: node("NewGeometry").outputs["Normal"]}).outputs[2]
    dust = _ramp(node, normal, 0.7, 1.6)
    set_("Base Color", _mix(node, dust, color, (0.30, 0.28, 0.25)))
    set_("Roughness", 0.5)


def _lit_windows(lit: bool) -> None:
    """Window panes. At night about half of them are lit."""
    node, set_ = _material("window")
    set_("Base Color", (0.02, 0.03, 0.035, 1.0))
    set_("Roughness", 0.08)
    if lit:
        where = node("TexCoord").outputs["Object"]
        on = _ramp(
            node,
            node(
                "TexWhiteNoise",
                {
                    0: node("VectorMath", {0: where, 1: (3.0, 3.0, 3.0)}, operation="SNAP").outputs[
                        0
                    ]
                },
            ).outputs[0],
            0.5,
            0.52,
        )
        set_("Emission Color", (1.0, 0.78, 0.5, 1.0))
        set_("Emission Strength", node("Math", {0: on, 1: 1.2}, operation="MULTIPLY").outputs[0])


def _lamp(name: str, color: tuple[float, float, float], strength: float) -> None:
    """The visible face of a lamp. It casts no light; a spot lamp next to it does."""
    _, set_ = _material(name)
    set_("Base Color", (0.6, 0.6, 0.6, 1.0))
    set_("Emission Color", (*color, 1.0))
    set_("Emission Strength", strength)


def _ground(name: str, tint: tuple[float, float, float], slab_m: float, wet: float) -> None:
    """Concrete slabs or asphalt with joints, stains and tyre marks; wet: share under water."""
    node, set_ = _material(name)
    where = node("NewGeometry").outputs["Position"]
    wide = _noise(node, where, 0.035, 3.0)
    fine = _noise(node, where, 2.5, 3.0)
    color = _mix(node, _ramp(node, wide, 0.3, 0.7), tuple(0.72 * c for c in tint), tint)
    grain = _mix(node, _ramp(node, fine, 0.3, 0.7), (0.82, 0.82, 0.82), (1.1, 1.1, 1.1))
    color = _mix(node, 1.0, color, grain, "MULTIPLY")
    tracks = node("Mapping", {"Vector": where, "Scale": (0.012, 0.55, 1.0)}).outputs[0]
    dark = _ramp(node, _noise(node, tracks, 1.0, 3.0), 0.5, 0.72)
    color = _mix(
        node,
        node("Math", {0: dark, 1: 0.6}, operation="MULTIPLY").outputs[0],
        color,
        tuple(0.35 * c for c in tint),
    )
    oil = _ramp(node, _noise(node, where, 0.35, 1.0), 0.66, 0.74)
    color = _mix(
        node,
        node("Math", {0: oil, 1: 0.55}, operation="MULTIPLY").outputs[0],
        color,
        (0.05, 0.048, 0.045),
    )
    if slab_m:
        brick = node(
            "TexBrick",
            {
                "Vector": where,
                "Color1": (1, 1, 1, 1),
                "Mortar": (0, 0, 0, 1),
                "Color2": (0.86, 0.86, 0.86, 1),
                "Scale": 1.0,
                "Mortar Size": 0.03,
                "Brick Width": slab_m,
                "Row Height": slab_m,
            },
            offset=0.0,
        )
        color = _mix(node, 0.75, color, brick.outputs[0], "MULTIPLY")
    set_("Base Color", color)
    if wet:
        pool = _ramp(node, _noise(node, where, 0.09, 3.0), 0.62 - 0.3 * wet, 0.72 - 0.3 * wet)
        dry = _mix(node, pool, color, tuple(0.3 * c for c in tint))
        set_("Base Color", dry)
        set_("Roughness", _ramp_to(node, pool, 0.8, 0.09))
    else:
        set_("Roughness", 0.85)


def _ramp_to(node: Any, value: Any, at_0: float, at_1: float) -> Any:
    return node("MapRange", {"Value": value, 3: at_0, 4: at_1}).outputs[0]


def _water(swell: float, tint: tuple[float, float, float]) -> None:
    """Waves of three lengths as bumps; those too small to see far away become roughness."""
    node, set_ = _material("water")
    where = node("NewGeometry").outputs["Position"]
    distance = node("CameraData").outputs["View Distance"]
    far = _ramp(node, distance, 0.0, 700.0)
    height = None
    for scale, size in ((0.045, 1.1), (0.22, 0.30), (0.9, 0.07)):
        stretched = node(
            "Mapping", {"Vector": where, "Rotation": (0, 0, 0.5 + scale), "Scale": (1.0, 0.45, 1.0)}
        ).outputs[0]
        part = node(
            "Math", {0: _noise(node, stretched, scale, 2.0), 1: size * swell}, operation="MULTIPLY"
        ).outputs[0]
        height = (
            part
            if height is None
            else node("Math", {0: height, 1: part}, operation="ADD").outputs[0]
        )
    bump = node(
        "Bump", {"Height": height, "Distance": 1.0, "Strength": _ramp_to(node, far, 1.0, 0.35)}
    )
    set_("Normal", bump.outputs[0])
    set_("Base Color", (*tint, 1.0))
    set_("Roughness", _ramp_to(node, far, 0.06, 0.22))
    set_("IOR", 1.33)


def _cladding() -> None:
    """Ribbed sheet walls in the object's own colour."""
    node, set_ = _material("cladding")
    info = node("ObjectInfo")
    where = node("TexCoord").outputs["Object"]
    wave = node("TexWave", {"Vector": where, "Scale": 0.6}, bands_direction="DIAGONAL")
    color = _mix(
        node,
        _ramp(node, _noise(node, where, 0.15), 0.4, 0.8),
        info.outputs["Color"],
        (0.22, 0.20, 0.18),
    )
    color = _mix(node, 0.35, color, wave.outputs[0], "MULTIPLY")
    set_("Base Color", color)
    set_("Roughness", 0.6)


def _hills(tint: tuple[float, float, float]) -> None:
    node, set_ = _material("hills")
    where = node("NewGeometry").outputs["Position"]
    patch = _ramp(node, _noise(node, where, 0.004, 6.0), 0.4, 0.6)
    set_("Base Color", _mix(node, patch, tint, tuple(0.5 * c for c in tint)))
    set_("Roughness", 1.0)


def build_materials(lamp_strength: float, wet: float, swell: float) -> None:
    """Create all materials.

    Args:
        lamp_strength: Radiance of lamps, 0 by day.
        wet: Share of wet ground, 0 to 1.
        swell: Height of the waves, relative to normal.
    """
    _plain()
    _painted("box", 0.5, 0.35)
    _painted("crane", 0.3, 0.12)
    _painted("hull", 0.35, 0.05)
    _lit_windows(lamp_strength > 0)
    _lamp("led", (1.0, 0.93, 0.82), lamp_strength)
    _lamp("sodium", (1.0, 0.52, 0.16), lamp_strength)
    _lamp("beacon", (1.0, 0.05, 0.03), 0.3 * lamp_strength)
    _ground("concrete", (0.29, 0.275, 0.25), 6.0, wet)
    _ground("asphalt", (0.11, 0.11, 0.112), 0.0, wet)
    _water(swell, (0.012, 0.035, 0.038))
    _cladding()
    _hills((0.075, 0.09, 0.045))
