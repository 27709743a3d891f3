"""Invalid and hostile configurations are errors with file, line, value and remedy; nothing in them is executed."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.carla import File, Options, import_configurations
from recipe_compiler.ir.errors import InputError
from recipe_compiler.library import towns

CAMERA = "  - blueprint: {name: sensor.camera.rgb}\n"
HEAD = "max_frames: 3\nspawn_actors:\n"
REFUSED = {
    "empty": ("", "config.yaml:1:1: the file is empty; name a configuration of CARLA's data collector"),
    "no actors": ("carla: {seed: 1}\n", "config.yaml:1:1: no configuration: none of the files has spawn_actors"),
    "a recipe": (
        "recipe: a\nbase: {clock: {fps: 10}}\n",
        "config.yaml:1:1: no configuration: none of the files has spawn_actors or actors; this is a recipe: build it as"
        " it is",
    ),
    "no camera": (
        HEAD + "  - blueprint: {name: vehicle.*}\n",
        "config.yaml:2:1: spawn_actors: the configuration has no camera; add a sensor, such as sensor.camera.rgb",
    ),
    "frames": (
        "max_frames: 0\nspawn_actors:\n" + CAMERA,
        "config.yaml:1:1: max_frames: 0 is out of range; write a number from 1 to 100000",
    ),
    "rate": (
        HEAD + CAMERA + "carla: {fps: 12.5}\n",
        "config.yaml:4:9: carla.fps: 12.5 steps per second is 12.5 frames per second; choose a whole number of frames"
        " per second, 1 to 1000",
    ),
    "town": (
        HEAD + CAMERA + "carla: {townmap: Atlantis}\n",
        "config.yaml:4:9: carla.townmap: CARLA has no town 'Atlantis'; write one of Town01 to Town07,"
        f" Town10HD, Town11, Town12, Town13, Town15, or choose one of {', '.join(towns.NAMES)} in the command",
    ),
    "no blueprint": (
        HEAD + CAMERA + "  - transform: {location: {x: 1}}\n",
        "config.yaml:4:5: spawn_actors[1]: it has no blueprint name; write the name of a blueprint, such as name:"
        " vehicle.*",
    ),
    "unknown blueprint": (
        HEAD + CAMERA + "  - blueprint: {name: vehicle.tesla.modelx}\n",
        'config.yaml:4:17: spawn_actors[1].blueprint.name: CARLA has no vehicle "vehicle.tesla.modelx"; write a'
        " blueprint of its catalogue, or vehicle.*",
    ),
    "position": (
        HEAD + CAMERA + "    transform: {location: {x: far}}\n",
        'config.yaml:4:28: spawn_actors[0].transform.location.x: it is "far"; write a number',
    ),
    "role": (
        HEAD + CAMERA + "    attach_to: nobody\n",
        'config.yaml:4:5: spawn_actors[0].attach_to: no entry has the role_name "nobody"; choose in the command the'
        " blueprint of an actor that another program spawns",
    ),
    "tick": (
        HEAD + "  - blueprint: {name: sensor.camera.rgb, attr: {sensor_tick: '0.05'}}\n",
        "config.yaml:3:49: spawn_actors[0].blueprint.attr.sensor_tick: 0.05 s is 1.5 frames at 30 frames per second;"
        " write 0.033333 or 0.066667, or 0 for every frame",
    ),
    "environment": (
        "max_frames: ${oc.env:FRAMES}\nspawn_actors:\n" + CAMERA,
        'config.yaml:1:1: max_frames: the reference "${oc.env:FRAMES}" cannot be resolved; write the value itself',
    ),
    "circle": (
        "a: ${b}\nb: ${a}\nmax_frames: ${a}\nspawn_actors:\n" + CAMERA,
        "config.yaml:1:4: a: the reference",
    ),
    "tag": (HEAD + CAMERA + "weather: !!python/object:os.system {}\n", "config.yaml:4:10: the tag"),
    "class": (
        "max_frames: 1\nactors:\n  a: {_target_: os.system}\n",
        'config.yaml:3:7: actors.a._target_: "system" is not a class of OSCAR\'s actors; write one of Camera, Sensor',
    ),
}


def refusal(*texts: str) -> str:
    files = [File(f"config{number or ''}.yaml", text.encode()) for number, text in enumerate(texts)]
    with pytest.raises(InputError) as caught:
        import_configurations(files)
    assert all(problem.help and "; " not in problem.help for problem in caught.value.problems)
    assert all(problem.place and problem.source is not None for problem in caught.value.problems)
    return str(caught.value)


@pytest.mark.parametrize("case", REFUSED)
def test_a_broken_configuration_is_refused_with_place_and_remedy(case: str) -> None:
    text, message = REFUSED[case]
    assert refusal(text).startswith(message)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"town": "Town01"}, "there is no town 'Town01'; write one of "),
        ({"hero": "sensor.camera.rgb"}, "CARLA has no vehicle or walker 'sensor.camera.rgb'; write a blueprint"),
        ({"hero": "vehicle.tesla.modelx"}, "CARLA has no vehicle or walker 'vehicle.tesla.modelx'; write a blueprint"),
        ({"frames": 100_001}, "100001 frames are out of range; write a number from 1 to 100000"),
        ({"vehicles": 251}, "251 vehicles are out of range; write a number from 0 to 250"),
        ({"pedestrians": -1}, "-1 pedestrians are out of range; write a number from 0 to 250"),
    ],
)
def test_a_broken_choice_is_refused_with_a_remedy(chosen: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Options(**chosen)
    assert str(caught.value).startswith(message)


def test_all_mistakes_are_reported_at_once() -> None:
    text = HEAD + CAMERA + "  - blueprint: {name: vehicle.none}\n  - blueprint: {}\ncarla: {fps: 0.5, seed: x}\n"
    places = [line.split(": ")[0] for line in refusal(text).splitlines()]
    assert places == ["config.yaml:5:5", "config.yaml:6:9", "config.yaml:6:19"]


HOSTILE = {
    "references": "a: [1, 2, 3, 4, 5, 6, 7, 8, 9]\n"
    + "".join(f"{b}: [{', '.join(['${' + a + '}'] * 9)}]\n" for a, b in zip("abcdef", "bcdefg", strict=True))
    + HEAD
    + CAMERA,
    "a chain of sensors": HEAD
    + CAMERA
    + "".join(
        f"  - {{blueprint: {{name: sensor.camera.rgb, attr: {{role_name: s{n}}}}}, attach_to: s{n - 1}}}\n"
        for n in range(1, 2000)
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_input_is_refused_quickly(case: str) -> None:
    assert refusal(HOSTILE[case])


@pytest.mark.slow
def test_long_keys_are_shortened_in_paths() -> None:
    """A report repeats the path of a value for each value below it."""
    text = f"? {'k' * 100_000}\n: [{'1, ' * 2000}]\n" + HEAD + CAMERA
    (one,) = import_configurations([File("config.yaml", text.encode())])
    assert sum(len(line) for line in one.report.lines()) < 500_000


def test_control_characters_are_escaped() -> None:
    text = HEAD + CAMERA + '"key\\u001b[31m": "\\u001b[2J"\noutput_dir: "\\u202e"\n'
    (one,) = import_configurations([File("config.yaml", text.encode())])
    assert all(line.isprintable() for line in [*one.report.lines(), *one.text.splitlines()])
