"""Any configuration is imported to a recipe with a complete report, or refused with problems."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.carla import File, import_configurations
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.source import yaml_reader
from recipe_compiler.source.yaml_reader import Plain

from tests.compiler.carla.importing import CONFIGS, PAPER

VALUES: list[Any] = [
    None, "", " ", "x", "1", "-1.5", "1e3", -1, 0, 7, 1e-9, -1e9, 1e300, True, False, [], {}, [1], [2, 1], [[1]], ["x"],
    {"x": 1}, {"name": "walker.*"}, {"_target_": "a.Walker"}, [{}], "${a}", "${max_frames}", "${spawn_actors}",
    "${oc.dict.values:actors}", "${oc.env:HOME}", "a${max_frames}b", "vehicle.*", "sensor.camera.rgb", "*", "ego",
    "\u001b[2J", "\u202e", "ä" * 200, "y: {", "# no", "null", "-", "spring_arm",
]  # fmt: skip
NAMES = ("every_key", "mobile_sensors", "following", "two_rigs", "aliases", "oscar_scene", "oscar_actors", "tracking")


def paths(value: Plain, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Return the paths of all values below a value."""
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield (*path, key)
        yield from paths(child, (*path, key))


FILES = [PAPER[0], *(CONFIGS / f"{name}.yaml" for name in NAMES)]
PARSED = {path.stem: yaml_reader.parse(path.read_bytes(), path.name)[0] for path in FILES}
CONFIGURATIONS = {name: root.plain for name, root in PARSED.items() if root is not None}
PATHS = {name: list(paths(value)) for name, value in CONFIGURATIONS.items()}


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """Return a configuration as JSON (a subset of YAML), with one to three values replaced or removed."""
    name = draw(st.sampled_from(sorted(CONFIGURATIONS)))
    document: Any = json.loads(json.dumps(CONFIGURATIONS[name]))
    for _ in range(draw(st.integers(1, 3))):
        *parents, last = draw(st.sampled_from(PATHS[name]))
        here = document
        try:
            for step in parents:
                here = here[step]
            if draw(st.booleans()):
                here[last] = draw(st.sampled_from(VALUES))
            elif isinstance(here[last], int | float):
                here[last] = draw(st.integers(-100, 100))
            else:
                del here[last]
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change removed this path
    return json.dumps(document, indent=1)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(mutated())
def test_an_import_ends_in_a_complete_report_or_in_problems(text: str) -> None:
    try:
        (one,) = import_configurations([File("config.yaml", text.encode())])
    except InputError as error:
        for problem in error.problems:
            assert problem.place is not None and problem.help and "; " not in problem.help, problem
            assert problem.code is not Code.INTERNAL
        return
    root, _ = yaml_reader.parse(text.encode(), "config.yaml")
    assert root is not None
    reported = {row.key for row in one.report.rows}
    assert {leaf.key for leaf in Node.root(root).leaves()} <= reported
    recipe, problems = yaml_reader.parse(one.text.encode(), "recipe.yaml")
    assert recipe is not None and not problems
    assert one.text.replace("\n", "").isprintable()
