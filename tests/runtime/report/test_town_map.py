"""`recipe shot --map` draws lanes in their directions and a recipe's actors at their places."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from PIL import Image
from recipe_cli.commands.shot import command
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_compiler.library import towns
from recipe_compiler.schema import template
from recipe_runtime.report import town_map
from recipe_runtime.report.canvas import Canvas
from recipe_runtime.report.town_map import Spots

from tests.compiler.kitchen import only, small


def spots(town: towns.Town) -> Spots:
    return Spots(town.spots["vehicle"], town.spots["pedestrian"], town.parking, town.streets.bounds)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Any]]:
    """Record the arguments of `arrow` and `text`, and each finished canvas with its picture."""
    seen: dict[str, list[Any]] = {"arrow": [], "text": [], "finished": []}

    def spy(name: str) -> Callable[..., Any]:
        whole = getattr(Canvas, name)

        def call(self: Canvas, *given: Any) -> Any:
            result = whole(self, *given)
            seen[name].append(given or (self, result))
            return result

        return call

    for name in seen:
        monkeypatch.setattr(Canvas, name, spy(name))
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("name", towns.NAMES)
def test_arrows_show_the_direction_of_traffic(name: str, drawn: dict[str, list[Any]]) -> None:
    """Users need a lane's direction to place vehicles and cameras."""
    town = towns.build(name, 0, {})
    body = town_map.town_map(town.plan, spots(town), name)
    with Image.open(io.BytesIO(body)) as page:
        assert (page.format, page.mode) == ("PNG", "RGB")
        assert max(page.size) < 2600
    canvas, picture = drawn["finished"][0]
    x0, y0, x1, y1 = canvas.box
    inside = [p for p in town.spots["vehicle"] if x0 + 20 < p.x < x1 - 20 and y0 + 20 < p.y < y1 - 20]
    assert len(inside) > 10
    for spot in inside:
        s, c = exact.sin_cos_deg(spot.yaw)
        beside = [
            arrow
            for arrow, *_ in drawn["arrow"]
            if abs(c * (arrow.y - spot.y) - s * (arrow.x - spot.x)) < 0.5
            and abs(c * (arrow.x - spot.x) + s * (arrow.y - spot.y)) < 14.0
        ]
        assert beside and all((arrow.yaw - spot.yaw) % 360 == 0 for arrow in beside)
        u, v = canvas.pixel((spot.x, spot.y))
        red, _, blue = picture.getpixel((int(u), int(v)))
        assert blue > red + 60, "a spawn point has its mark"


def first(folder: Path, more: str = "") -> tuple[ScenarioPlan, towns.Town]:
    """Return the scenario of the first template, with more of its base, and its town."""
    path = folder / "first.yaml"
    path.write_text(template("first").replace("base:\n", f"base:\n{more}", 1))
    compiled = compile_recipe(path)
    scenario = compiled.plan.variants[0]
    return scenario, compiled.towns[scenario.scene.town.digest]


@pytest.mark.slow
def test_actors_of_a_recipe_are_marked_by_name(tmp_path: Path, drawn: dict[str, list[Any]]) -> None:
    scenario, town = first(tmp_path)
    town_map.town_map(town.plan, spots(town), "first", scenario)
    assert {words: place for place, words, *_ in drawn["text"]} == {
        "hero": (34.0, 44.6),
        "friend": (20.0, 43.6),
        "car": (48.0, 37.5),
        "street": (14.0, 43.2),
    }


@pytest.mark.slow
def test_traffic_is_distinguished_by_kind(tmp_path: Path, drawn: dict[str, list[Any]]) -> None:
    """Cars, pedestrians and parked cars were one and the same dot."""
    scenario, town = first(tmp_path, "  traffic: {vehicles: 4, pedestrians: 4, parked: 4}\n")
    traffic = tuple(actor for actor in scenario.scene.actors if actor.name.startswith("traffic."))
    scenario = scenario.model_copy(update={"scene": scenario.scene.model_copy(update={"actors": traffic})})
    scenario = scenario.model_copy(update={"rig": scenario.rig.model_copy(update={"sensors": ()})})
    town_map.town_map(town.plan, Spots((), (), (), town.streets.bounds), "first", scenario)
    canvas, picture = drawn["finished"][0]
    seen: dict[str, set[tuple[str, bool]]] = {}
    for actor in traffic:
        s, c = exact.sin_cos_deg(actor.start.yaw)
        colours = []
        for ahead in (0.0, 1.1):  # metres; the second is outside a pedestrian's disc, and within a vehicle
            x, y = ahead * c - 0.5 * s, ahead * s + 0.5 * c
            u, v = canvas.pixel((actor.start.x + x, actor.start.y + y))
            red, green, blue = picture.getpixel((int(u), int(v)))
            colours.append("yellow" if min(red, green) > blue + 90 else "teal" if green > red + 40 else "other")
        seen.setdefault(actor.name.split(".")[1], set()).add((colours[0], colours[0] == colours[1]))
    assert seen == {"vehicle": {("yellow", True)}, "pedestrian": {("yellow", False)}, "parked": {("teal", True)}}


@pytest.mark.slow
def test_traffic_lights_and_stop_signs_are_shown(drawn: dict[str, list[Any]]) -> None:
    """Drivers obey them, so the map shows which junction has which."""
    town = towns.build("downtown", 0, {})
    town_map.town_map(town.plan, spots(town), "downtown")
    canvas, picture = drawn["finished"][0]
    for element in town.plan.elements:
        if element.kind == "traffic_light" or (element.kind == "sign" and int(element.shape["face"]) == 0):
            u, v = canvas.pixel((element.pose.x, element.pose.y))
            red, green, blue = picture.getpixel((int(u), int(v)))
            assert red > blue + 90, element.name  # the amber centre of a light; the red of a sign
            assert (green > 120) == (element.kind == "traffic_light")


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, list(arguments), catch_exceptions=False)


@pytest.mark.slow
def test_the_command_draws_a_recipe_or_a_town(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "first.yaml").write_text(template("first"))
    assert run("--map", "first.yaml").stdout == "first-map.png: downtown from above\n"
    reported = json.loads(run("--map", "plaza", "-o", "square.png", "--json").stdout)
    assert reported.items() >= {"file": "square.png", "town": "plaza", "variant": None}.items()
    for name in ("first-map.png", "square.png"):
        with Image.open(tmp_path / name) as picture:
            assert picture.size[0] > 1000


def test_a_misspelt_town_or_a_frame_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r'downtwn: there is no such file or town; did you mean "downtown"\?'):
        run("--map", "downtwn")
    with pytest.raises(InputError, match="there is no such file"):
        run("--map", "downtwn.yaml")  # a file's name
    with pytest.raises(InputError, match="--map draws a town, not a frame"):
        run("--map", "plaza", "--frame", "3")


@pytest.mark.parametrize(("y", "shown"), [(None, 320.0), (250.0, 560.0)])
def test_the_map_of_a_large_town_shows_a_part_with_every_named_actor(
    drawn: dict[str, list[Any]], y: float | None, shown: float
) -> None:
    """Regression: actors outside the central 320 m of a highway were drawn at the map's border."""
    town = towns.build("highway", 0, {})
    scenario = None
    if y is not None:
        recipe = small(town="highway", actors={"a": {"blueprint": "vehicle.sedan.*", "start": {"x": 4, "y": y}}})
        recipe["base"]["sensors"] = {"s": {"mount": {"x": 0, "y": -y, "z": 3}, "capture": ["rgb"]}}
        scenario = only(recipe)
    town_map.town_map(town.plan, spots(town), "highway", scenario)
    canvas, _ = drawn["finished"][0]
    assert canvas.box[3] - canvas.box[1] == shown
    assert y is None or canvas.box[1] <= -y < y <= canvas.box[3]
