"""Where a pixel of a frame comes from: body, surface, place, light, patch, and the fields of the plan that say so."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan

from recipe_runtime.attacks.truth import patch_truth
from recipe_runtime.cache.store import Store
from recipe_runtime.core.interfaces import Observed, Progress
from recipe_runtime.core.transforms import sensor_transform, transform_points
from recipe_runtime.frames.engines import Engines
from recipe_runtime.frames.shot import observed
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.modalities import label_array
from recipe_runtime.modalities.normals import NAME as NORMALS

if TYPE_CHECKING:
    from recipe_runtime.render.scene.geometry import SurfaceKey

Origin = dict[str, object]


def pixel_origin(
    scenario: ScenarioPlan,
    frame: int,
    x: int,
    y: int,
    sensor: str | None = None,
    *,
    engines: Engines | None = None,
    store: Store | None = None,
    device: str = "cpu",
    progress: Progress,
) -> Origin:
    """Return where a pixel comes from, as plain JSON.

    Args:
        scenario: The variant.
        frame: Number of the frame.
        x: Column of the pixel, from the left.
        y: Row of the pixel, from the top.
        sensor: Name of the sensor, the first by default.
        engines: Simulator and renderer.
        store: The cache.
        device: Where the frame is rendered.
        progress: Told what is being done.

    Returns:
        `sensor`, `frame`, `pixel`; `rgb` (of 255); `depth` (metres along the optical axis) and `place` (metres in the
        world frame), None for the sky; `body`, `surface`, `patch` and `light`, see the functions below. Each has
        `plan`, the paths of the plan's fields that it follows from.

    Raises:
        InputError: There is no such sensor, frame or pixel.
    """
    with observed(scenario, sensor, frame, engines, store, device, progress) as (source, plan, number, seen):
        camera = plan.camera
        if not (0 <= x < camera.width and 0 <= y < camera.height):
            raise InputError(
                f"{x}, {y} is outside of the picture",
                help=f"x is 0 to {camera.width - 1}, and y is 0 to {camera.height - 1}",
                code=Code.OUT_OF_RANGE,
            )
        picture = source.shade(seen, scenario.appearance, plan, number)
        key = seen.surfaces.at(x, y)  # type: ignore[attr-defined]  # an `Observation`
        origin: Origin = {
            "variant": scenario.variant,
            "sensor": plan.name,
            "frame": number,
            "pixel": [x, y],
            "rgb": picture[y, x].tolist(),
            "depth": None if key is None else round(float(seen.depth[y, x]), 4),
            "place": None if key is None else _place(seen, plan, source, number, x, y),
            "body": None if key is None else _body(scenario, key.body, key.instance),
            "surface": None if key is None else _surface(scenario, key),
            "patch": _patch(scenario, plan, source, seen, number, x, y),
            "light": _light(scenario, plan, seen, source, number, None if key is None else (x, y)),
        }
    return origin


def _place(seen: Observed, plan: SensorPlan, source: SceneSource, frame: int, x: int, y: int) -> list[float] | None:
    """Return the place that a pixel shows, in the world frame; None if the lens is distorted."""
    camera = plan.camera
    if camera.lens_k or camera.lens_kcube:
        return None
    focal = camera.width / 2.0 / _tangent(camera.fov / 2.0)
    depth = float(seen.depth[y, x])
    left, up = (camera.width / 2.0 - x - 0.5) / focal, (camera.height / 2.0 - y - 0.5) / focal
    point = np.array([[depth, left * depth, up * depth]])
    found = transform_points(sensor_transform(plan, source.trace, frame), point)[0]
    return [round(float(v), 4) for v in found]


def _tangent(degrees: float) -> float:
    sine, cosine = exact.sin_cos_deg(degrees)
    return sine / cosine


def _body(scenario: ScenarioPlan, name: str, instance: int) -> Origin:
    """Return name and kind of a body, and where the plan defines it."""
    for number, actor in enumerate(scenario.scene.actors):
        if actor.name == name:
            return {"name": name, "kind": actor.blueprint, "instance": instance, "plan": [f"scene.actors.{number}"]}
    for number, prop in enumerate(scenario.scene.props):
        if prop.name == name:
            return {"name": name, "kind": "prop", "instance": instance, "plan": [f"scene.props.{number}"]}
    for number, element in enumerate(scenario.scene.town.elements):
        if element.name == name:
            return {"name": name, "kind": element.kind, "instance": 0, "plan": [f"scene.town.elements.{number}"]}
    return {"name": name, "kind": "town", "instance": instance, "plan": ["scene.town"]}


def _surface(scenario: ScenarioPlan, key: SurfaceKey) -> Origin:
    """Return slot, pattern (material) and CARLA's tag of a surface; its colour or image, and where the plan has it."""
    look, paths = scenario.appearance, []
    colour = look.looks.root.get(key.body, {}).get(key.slot)
    image = look.textures.get(key.body, {}).get(key.slot)
    paths += [f"appearance.looks.{key.body}.{key.slot}"] if colour is not None else []
    paths += [f"appearance.textures.{key.body}.{key.slot}"] if image is not None else []
    return {
        "slot": key.slot,
        "material": key.pattern.name.lower(),
        "tag": key.tag,
        "colour": colour,
        "image": None if image is None else str(image),
        "plan": paths,
    }


def _patch(
    scenario: ScenarioPlan, sensor: SensorPlan, source: SceneSource, seen: Observed, frame: int, x: int, y: int
) -> Origin | None:
    """Return the patch that a pixel shows; if it is a rectangle, the place in its texture, u and v from 0 to 1."""
    look = scenario.appearance
    number = int(source.patch_map(seen, look, frame)[y, x]) if look.patches else 0
    if number == 0:
        return None
    patch = look.patches[number - 1]
    found: Origin = {"name": patch.name, "mode": patch.mode, "plan": [f"appearance.patches.{number - 1}"]}
    truth = patch_truth(source, look, sensor, seen, frame)["patches"]
    shape = next(record["homography"] for record in truth if record["name"] == patch.name)
    if shape is not None and not (sensor.camera.lens_k or sensor.camera.lens_kcube):
        (a, b, c), (d, e, f), (g, h, i) = shape
        px, py = x + 0.5, y + 0.5
        ru, rv, r = a - g * px, b - h * px, i * px - c  # ru u + rv v = r, and the same for the row
        su, sv, q = d - g * py, e - h * py, i * py - f
        across = ru * sv - rv * su
        if across != 0.0:
            found["texel"] = [round((r * sv - rv * q) / across, 4), round((ru * q - r * su) / across, 4)]
    return found


def _light(
    scenario: ScenarioPlan,
    plan: SensorPlan,
    seen: Observed,
    source: SceneSource,
    frame: int,
    pixel: tuple[int, int] | None,
) -> Origin:
    """Return sun and weather, and how steeply the sun falls on the surface (degrees; below 0, it is behind it)."""
    look = scenario.appearance
    weather = {name: value for name, value in look.weather.model_dump().items() if value}
    light: Origin = {"sun": {"azimuth": look.sun.azimuth, "altitude": look.sun.altitude}, "weather": weather}
    light["plan"] = ["appearance.sun", "appearance.weather", f"appearance.responses.{plan.name}"]
    if pixel is None or look.sun.altitude <= 0.0:
        return light
    normal = label_array(seen, NORMALS)[pixel[1], pixel[0]].astype(np.float64)
    to_world = sensor_transform(plan, source.trace, frame)[:, :3]
    right, down, ahead = (float(v) for v in normal)
    world = transform_points(np.concatenate([to_world, np.zeros((3, 1))], axis=1), np.array([[ahead, -right, -down]]))[
        0
    ]
    s, c = exact.sin_cos_deg(look.sun.azimuth)
    rise, level = exact.sin_cos_deg(look.sun.altitude)
    cosine = world[0] * c * level + world[1] * s * level + world[2] * rise
    light["sun_on_surface"] = round(float(cosine), 4)
    return light
