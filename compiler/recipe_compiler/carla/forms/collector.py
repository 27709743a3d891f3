"""Reads `spawn_actors` in the form of CARLA's data collector (pull request 4992)."""

from __future__ import annotations

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.forms.specs import Kind, Spec, ignore_others, read_transform
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code
from recipe_compiler.source.yaml_reader import show

_KEYS = ("blueprint", "transform", "destination_transform", "sensor_motion", "attach_to", "attachment", "sensors")
_UNKNOWN = "the collector has no such key and does not read it"
_MISSING = "write the name of a blueprint, such as name: vehicle.*"
CAMERAS = {
    "sensor.camera.rgb": "rgb",
    "sensor.camera.depth": "depth",
    "sensor.camera.instance_segmentation": "instance",
    "sensor.camera.semantic_segmentation": "semantic",
}
MODALITIES = {name.rsplit(".", 1)[1]: modality for name, modality in CAMERAS.items()}


def read(reader: Reader, root: Node) -> list[Spec]:
    """Read the entries of `spawn_actors`, nested sensors after the entry that contains them."""
    specs: list[Spec] = []
    for node in reader.items(root.get("spawn_actors")):
        _read(reader, node, None, specs)
    return specs


def _read(reader: Reader, node: Node, container: Spec | None, specs: list[Spec]) -> None:
    if reader.map(node) is None:
        return
    blueprint = reader.map(node.get("blueprint"))
    name_node = None if blueprint is None else blueprint.get("name")
    name = reader.text(name_node)
    if blueprint is None or name_node is None or name is None:
        if name_node is None and (blueprint is not None or node.get("blueprint") is None):
            reader.reject(node, "it has no blueprint name", _MISSING, Code.MISSING_KEY)
        return
    kind = kind_of(name)
    if kind is None:
        ignore(reader, node, name_node, name)
        return
    reader.ledger.ignored(blueprint.get("pace"), "CARLA's blueprints have the speed of a pace: write speed, in m/s")
    motion, attributes = reader.map(node.get("sensor_motion")), reader.map(blueprint.get("attr"))
    for parent, known in ((node, _KEYS), (blueprint, ("name", "attr", "speed")), (motion, ("jitter_magnitude",))):
        ignore_others(reader, parent, known, _UNKNOWN)
    spec = Spec(
        node=node,
        kind=kind,
        blueprint=name,
        name_node=name_node,
        attributes={} if attributes is None else {str(child.path[-1]): child for child in attributes.children()},
        transform=read_transform(reader, node.get("transform"), ranges=False),
        goal=read_transform(reader, node.get("destination_transform"), ranges=False),
        speed=blueprint.get("speed"),
        jitter=None if motion is None else reader.map(motion.get("jitter_magnitude")),
        role=node.get("attach_to"),
        container=container,
        attachment=node.get("attachment"),
        modalities=((CAMERAS[name], name_node),) if kind == "sensor" else (),
    )
    specs.append(spec)
    for child in reader.items(node.get("sensors")):
        _read(reader, child, spec, specs)


def kind_of(name: str) -> Kind | None:
    """Return the kind of a blueprint or glob; None if the recipe language has no such kind."""
    families: dict[str, Kind] = {"walker": "walker", "vehicle": "vehicle"}
    return "sensor" if name in CAMERAS else families.get(name.split(".", 1)[0])


def ignore(reader: Reader, node: Node, name_node: Node, name: str) -> None:
    """Record that an entry is ignored, or report a problem if CARLA cannot have its blueprint."""
    family = name.split(".", 1)[0]
    if family not in ("sensor", "static", "controller", "spectator", "traffic", "util"):
        remedy = "write walker.*, vehicle.* or the name of a sensor, such as sensor.camera.rgb"
        reader.reject(name_node, f"{show(name)} is not a blueprint of CARLA's", remedy, Code.UNKNOWN_NAME)
        return
    cameras = f"recipes do not have {show(name)}; they have the cameras {', '.join(sorted(MODALITIES))}"
    reader.ledger.ignored(node, cameras if family == "sensor" else f"recipes have nothing like {show(name)}")
