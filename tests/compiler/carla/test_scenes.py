"""Conversion of entries: parents, sensors, blueprints, names, positions, traffic and weathers."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from recipe_compiler.carla import File, Options, import_configurations
from recipe_compiler.carla.catalogue import blueprints as catalogue
from recipe_compiler.carla.placement import Site
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_compiler.library import blueprints
from recipe_compiler.library.towns import NAMES

from tests.compiler.carla.importing import CONFIGS, OSCAR, PAPER, compiled, import_files, import_text

HEAD = "max_frames: 4\ncarla: {seed: 3, townmap: Town15}\nspawn_actors:\n"


def plan_of(text: str, folder: Path) -> ScenarioPlan:
    (plan,) = compiled(import_text(text), folder).plan.variants
    return plan


def test_the_weathers_of_the_paper_are_the_variants(tmp_path: Path) -> None:
    (one,) = import_files(*PAPER)
    plans = {plan.variant: plan for plan in compiled(one, tmp_path).plan.variants}
    assert list(plans) == ["weather=config", "weather=rainy", "weather=foggy"]
    first, rainy, foggy = plans.values()
    assert first.scene.digest == rainy.scene.digest == foggy.scene.digest
    assert (rainy.appearance.weather.precipitation, rainy.appearance.sun.altitude) == (60, 15)
    assert (foggy.appearance.weather.fog_density, foggy.appearance.weather.cloudiness) == (100, 0)
    assert first.rig.sensors[0].capture == ("rgb", "depth", "instance")


def test_the_pedestrians_of_the_paper_pass_each_other_in_front_of_the_camera(tmp_path: Path) -> None:
    (one,) = import_files(*PAPER)
    plan = compiled(one, tmp_path).plan.variants[0]
    camera, (one_walker, other) = plan.rig.sensors[0].poses[0], plan.scene.actors
    assert (one_walker.start.x - camera.x, one_walker.start.y - camera.y) == (4, -10)
    assert (other.start.x - camera.x, other.start.y - camera.y) == (4, 10)
    assert (one_walker.route[-1].x, one_walker.route[-1].y) == (other.start.x, other.start.y)
    assert (one_walker.start.yaw, other.start.yaw, camera.yaw) == (90, -90, 0)
    assert (one_walker.speed, other.speed) == (1.4, 2.0)


@pytest.mark.parametrize("attachment", ["rigid", "spring_arm", "SpringArmGhost"])
def test_a_sensor_on_a_vehicle_is_carried(attachment: str, tmp_path: Path) -> None:
    text = HEAD + "  - blueprint: {name: 'vehicle.*', attr: {role_name: car}}\n"
    text += "  - blueprint: {name: sensor.camera.rgb}\n    attach_to: car\n"
    text += f"    attachment: {attachment}\n    transform: {{location: {{x: -5, z: 3}}}}\n"
    plan = plan_of(text, tmp_path)
    assert plan.rig.sensors[0].on == "car"
    assert (plan.rig.sensors[0].arm is None) == (attachment == "rigid")


@pytest.mark.parametrize("form", ["weather: {}", "context: {{weather_params: {}}}", "weather_params: {}", "{}"])
def test_a_file_of_weather_is_a_variant_in_every_form(form: str, tmp_path: Path) -> None:
    text = HEAD + "  - blueprint: {name: sensor.camera.rgb}\nweather: {cloudiness: 40, wetness: 5}\n"
    one = import_text(text, form.format("{wetness: 70, fog_density: 8}"))
    own, other = compiled(one, tmp_path).plan.variants
    assert (own.variant, other.variant) == ("weather=config", "weather=weather0")
    assert (own.appearance.weather.wetness, own.appearance.weather.cloudiness) == (5, 40)
    assert (other.appearance.weather.wetness, other.appearance.weather.fog_density) == (70, 8)
    assert other.appearance.weather.cloudiness == 40  # a key missing in the file has the configuration's value


def test_files_of_oscar_are_classified_by_content(tmp_path: Path) -> None:
    """Its collector.yaml has no actors, and the file of a Hydra group does not contain the name of the group."""
    collector = "defaults: [_self_]\nmax_frames: ???\nactors: {}\nspawn_actors: ${oc.dict.values:actors}\n"
    context = "sync_params: {fps: 12}\nclient_params: {seed: 5}\n"
    scene = "max_frames: 2\nactors: {eye: {_target_: a.Camera, modalities: [rgb]}}\n"
    files = [File(f"{number}.yaml", text.encode()) for number, text in enumerate((collector, context, scene))]
    (one,) = import_configurations(files)
    (plan,) = compiled(one, tmp_path).plan.variants
    assert (one.name, plan.scene.clock.fps, plan.scene.clock.frames, plan.appearance.seed) == ("2", 12, 2, 5)
    assert {(row.place.file, row.key) for row in one.report.rows} >= {
        ("0.yaml", "max_frames"),
        ("0.yaml", "spawn_actors"),
        ("1.yaml", "context.sync_params.fps"),
        ("2.yaml", "actors.eye.modalities[0]"),
    }


HERO = "  - blueprint: {name: sensor.camera.rgb}\n    attach_to: hero\n    transform: {location: {x: -6, z: 2}}\n"


def test_a_hero_of_another_program_is_a_car_that_carries_the_sensor(tmp_path: Path) -> None:
    """ScenarioRunner, manual control and generate_traffic.py --hero spawn it; the collector waits for its role."""
    plan = plan_of(HEAD + HERO, tmp_path)
    (hero,) = plan.scene.actors
    assert (hero.name, hero.category, plan.rig.sensors[0].on) == ("hero", "vehicle", "hero")
    assert hero.route or hero.speed > 0
    one = import_text(HEAD + HERO)
    (default,) = (each for each in one.report.defaults if each.to == "base.actors.hero.blueprint")
    assert "vehicle.lincoln.mkz_2017" in default.why and any("hero" in note for note in one.report.notes)


@pytest.mark.parametrize(
    ("blueprint", "category"), [("vehicle.audi.etron", "vehicle"), ("walker.pedestrian.*", "pedestrian")]
)
def test_the_blueprint_of_a_hero_of_any_role_can_be_chosen(blueprint: str, category: str, tmp_path: Path) -> None:
    one = import_text(HEAD + HERO + HERO.replace("hero", "ego vehicle"), options=Options(hero=blueprint))
    (plan,) = compiled(one, tmp_path).plan.variants
    assert [(actor.name, actor.category) for actor in plan.scene.actors] == [
        ("hero", category),
        ("ego_vehicle", category),
    ]
    assert [sensor.on for sensor in plan.rig.sensors] == ["hero", "ego_vehicle"]


def test_a_hero_of_the_configuration_is_not_replaced(tmp_path: Path) -> None:
    text = HEAD + HERO + "  - blueprint: {name: walker.pedestrian.*, attr: {role_name: hero}}\n"
    one = import_text(text, options=Options(hero="vehicle.tesla.model3"))
    assert [actor.category for actor in compiled(one, tmp_path).plan.variants[0].scene.actors] == ["pedestrian"]
    assert any("hero chosen in the command is not used" in note for note in one.report.notes)


@pytest.mark.parametrize(("text", "options", "frames"), [("", None, 300), ("", Options(frames=7), 7), ("9", None, 9)])
def test_frames_are_those_of_the_command_or_the_configuration(
    text: str, options: Options | None, frames: int, tmp_path: Path
) -> None:
    """Without max_frames the collector records until it is stopped."""
    head = HEAD.replace("max_frames: 4\n", f"max_frames: {text}\n" if text else "")
    one = import_text(head + "  - blueprint: {name: sensor.camera.rgb}\n", options=options)
    assert compiled(one, tmp_path).plan.variants[0].scene.clock.frames == frames
    assert any(each.to == "base.clock.frames" for each in one.report.defaults) == (not text)


def test_the_command_overrides_max_frames() -> None:
    one = import_text(HEAD + "  - blueprint: {name: sensor.camera.rgb}\n", options=Options(frames=6))
    (row,) = (row for row in one.report.rows if row.key == "max_frames")
    assert (row.outcome, row.value, row.written) == ("mapped", "4", "6") and "command" in row.why


def test_traffic_of_the_command_is_added_to_that_of_the_configuration(tmp_path: Path) -> None:
    (one,) = import_files(CONFIGS / "oscar_first.yaml", options=Options(vehicles=3))
    (plan,) = compiled(one, tmp_path).plan.variants
    kinds = [actor.category for actor in plan.scene.actors]
    assert (kinds.count("vehicle"), kinds.count("pedestrian")) == (4 + 3, 6 + 1)


def test_the_first_form_of_oscar_has_modalities_motion_and_traffic(tmp_path: Path) -> None:
    """Regression: only instance segmentation was imported, and neither motion nor traffic."""
    (one,) = import_files(CONFIGS / "oscar_first.yaml")
    (plan,) = compiled(one, tmp_path).plan.variants
    moving, still = plan.rig.sensors
    assert (moving.capture, still.capture) == (("rgb", "instance"), ("rgb", "depth", "instance"))
    steps = [((a.x - b.x) ** 2 + (a.y - b.y) ** 2) ** 0.5 for a, b in pairwise(moving.poses)]
    assert steps == pytest.approx([0.5] * 11)
    assert len({(pose.x, pose.y) for pose in still.poses}) == 1
    walker = plan.scene.actors[0]
    assert (walker.route[-1].x - walker.start.x, walker.route[-1].y - walker.start.y) == pytest.approx((0, 14))


def test_a_slow_sensor_captures_fewer_frames(tmp_path: Path) -> None:
    text = HEAD + "  - blueprint: {name: sensor.camera.rgb, attr: {sensor_tick: '0.1'}}\n"
    assert plan_of(text, tmp_path).rig.sensors[0].interval == 3
    assert plan_of(text.replace("0.1", "0.001"), tmp_path).rig.sensors[0].interval == 1


def test_a_sensor_inside_a_moving_sensor_belongs_to_its_rig(tmp_path: Path) -> None:
    text = HEAD + "  - blueprint: {name: sensor.camera.rgb}\n    transform: {location: {x: 1, z: 2}}\n"
    text += "    sensor_motion: {jitter_magnitude: {x: 0.1}}\n    sensors:\n"
    text += "      - blueprint: {name: sensor.camera.depth}\n"
    (sensor,) = plan_of(text, tmp_path).rig.sensors
    assert sensor.capture == ("rgb", "depth")
    with pytest.raises(InputError, match="which moves, but has a different pose"):
        import_text(text + "        transform: {location: {x: 1}}\n")


def test_the_scene_of_oscar_has_patch_crowd_and_warm_up(tmp_path: Path) -> None:
    (one,) = import_files(*OSCAR)
    (plan,) = compiled(one, tmp_path).plan.variants
    kinds = [actor.category for actor in plan.scene.actors]
    assert (kinds.count("vehicle"), kinds.count("pedestrian")) == (12, 6)
    assert (plan.scene.clock.fps, plan.scene.clock.frames, plan.scene.clock.warmup) == (10, 1, 2.0)
    (board,) = plan.scene.props
    camera = plan.rig.sensors[0].poses[0]
    # The centre of the patch: (-47.5, 20.5) in OSCAR, with the camera at (-50, -15), left-handed.
    middle = (board.pose.x, board.pose.y - 47.25 / 2)
    assert (middle[0] - camera.x, middle[1] - camera.y) == pytest.approx((2.5, -35.5))
    assert (board.pose.pitch, camera.pitch, camera.yaw) == (-90, 50, -82)


def test_the_sensor_of_oscar_follows_the_road(tmp_path: Path) -> None:
    (one,) = import_files(CONFIGS / "oscar_actors.yaml")
    (plan,) = compiled(one, tmp_path).plan.variants
    poses = plan.rig.sensors[1].poses
    steps = [((a.x - b.x) ** 2 + (a.y - b.y) ** 2) ** 0.5 for a, b in pairwise(poses)]
    assert steps == pytest.approx([1.0] * 9)
    assert {pose.z for pose in poses} == {3.0}
    hero = plan.scene.actors[0]
    assert 85 < hero.start.yaw < 95 and hero.speed == 1.2
    assert plan.scene.actors[1].speed == 0


@pytest.mark.parametrize("town", NAMES)
def test_a_configuration_fits_into_every_town(town: str, tmp_path: Path) -> None:
    (one,) = import_files(CONFIGS / "every_key.yaml", options=Options(town=town))
    assert compiled(one, tmp_path).plan.variants[0].scene.town.name == town


def test_carlas_blueprints_become_those_of_the_library() -> None:
    for name in catalogue._CLOSEST:
        kind = name.split(".")[0]
        found = catalogue.closest_match(name, kind, 0, "actor")
        assert found is not None and blueprints.match(found[0]), name
    assert catalogue.closest_match("walker.pedestrian.0009", "walker", 0, "a") != ("walker.pedestrian.0009", "")
    chosen = {catalogue.closest_match("vehicle.audi.*", "vehicle", seed, "a") for seed in range(40)}
    assert len(chosen) == 3  # a2, etron, tt
    again = {catalogue.closest_match("vehicle.audi.*", "vehicle", 5, "a") for _ in range(3)}
    assert len(again) == 1
    assert catalogue.closest_match("vehicle.none", "vehicle", 0, "a") is None


def test_a_moving_sensor_passes_through_no_building(tmp_path: Path) -> None:
    (one,) = import_files(CONFIGS / "mobile_sensors.yaml")
    (plan,) = compiled(one, tmp_path).plan.variants
    poses, obstacles = plan.rig.sensors[0].poses, Site("downtown").town.obstacles
    across = obstacles.across((poses[0].x, poses[0].y, poses[-1].x, poses[-1].y), 0.0)
    assert not [each.name for each in across if each.kind == "building"]


def test_all_positions_are_moved_by_one_vector(tmp_path: Path) -> None:
    (one,) = import_files(CONFIGS / "crowded.yaml")
    (plan,) = compiled(one, tmp_path).plan.variants
    walkers = [actor.start for actor in plan.scene.actors if actor.category == "pedestrian"]
    first = walkers[0]
    given = [(0, 0), (10, 0), (20, 0), (30, 0), (40, -5)]
    moved = {default.to for default in one.report.defaults if default.to.endswith(".start")}
    for number, (walker, place) in enumerate(zip(walkers, given, strict=True), 1):
        if f"base.actors.walker{number}.start" not in moved:
            assert (walker.x - first.x, walker.y - first.y) == pytest.approx(place)
