"""Every key of a configuration is in the report of its import, with file and line."""

from __future__ import annotations

from importlib import reload
from pathlib import Path

import pytest
from recipe_compiler.carla import weather
from recipe_compiler.ir.weather import PARAMETERS, Parameter

from tests.compiler.carla.importing import TOGETHER, compiled, import_files, import_text, leaves

OSCAR_ACTORS = "oscar_datagen_tools.simulation.actors"


@pytest.mark.slow
@pytest.mark.parametrize("name", TOGETHER)
def test_every_leaf_of_the_input_is_in_the_report_with_a_target_or_a_reason(name: str) -> None:
    for one in import_files(*TOGETHER[name]):
        found = [(row.place.file, row.place.line, row.key) for row in one.report.rows]
        assert len(set(found)) == len(found)
        # An alias is a separate place in the input; its content is reported at its anchor.
        assert {leaf for path in TOGETHER[name] for leaf in leaves(path)} <= set(found) or name == "aliases"
        for row in one.report.rows:
            assert row.to or row.why, row
            assert row.outcome != "mapped" or (row.why and (row.to or row.written)), row
            assert row.outcome != "ignored" or not row.to, row
        assert sum(one.report.counts().values()) == len(one.report.rows)


@pytest.mark.parametrize("name", TOGETHER)
def test_the_recipe_compiles_and_has_its_values_at_the_reported_paths(name: str, tmp_path: Path) -> None:
    for one in import_files(*TOGETHER[name]):
        assert compiled(one, tmp_path).plan.recipe == one.name
        assert one.text.isascii() or one.text.replace("\n", "").isprintable()
        assert max(map(len, one.text.splitlines())) <= 120


@pytest.mark.slow
def test_a_misspelt_weather_parameter_is_reported_with_the_nearest() -> None:
    """The collector ignores it, so a configuration can have one without notice."""
    text = "max_frames: 1\nweather: {fog_densty: 5}\nspawn_actors:\n  - blueprint: {name: sensor.camera.rgb}\n"
    (row,) = (row for row in import_text(text).report.rows if row.key == "weather.fog_densty")
    assert row.why == "CARLA has no such weather parameter, did you mean fog_density?"


@pytest.mark.parametrize("parameter", ["motion_blur_intensity", "lens_k", "lens_kcube"])
def test_a_parameter_with_another_unit_is_mapped(parameter: str) -> None:
    """Regression: it was reported as kept, which means the same value with the same meaning."""
    for value, outcome in (("0.02", "mapped"), ("0", "kept")):
        camera = f"{{name: sensor.camera.rgb, attr: {{{parameter}: '{value}'}}}}"
        text = f"max_frames: 1\nspawn_actors:\n  - blueprint: {camera}\n"
        (row,) = (row for row in import_text(text).report.rows if row.key.endswith(parameter))
        assert (row.outcome, bool(row.why)) == (outcome, outcome == "mapped")


def test_a_parameter_that_carla_lacks_is_not_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(PARAMETERS, "pollen", Parameter("percent of pollen", in_carla=False))
        reload(weather)
        one = import_text(
            "max_frames: 1\nweather: {pollen: 3}\nspawn_actors:\n  - blueprint: {name: sensor.camera.rgb}\n"
        )
    reload(weather)
    (row,) = (row for row in one.report.rows if row.key == "weather.pollen")
    assert row.outcome == "ignored"
    assert "pollen" not in one.text


def test_a_range_of_angles_beyond_a_turn_is_moved_into_it() -> None:
    """Regression: the recipe was invalid, or not, depending on the first value that was drawn."""
    text = f"""
max_frames: 1
actors:
  c:
    _target_: {OSCAR_ACTORS}.Camera
    modalities: [rgb]
    transform: {{location: {{z: 9}}, rotation: {{yaw: [350, 370], pitch: [300, 320], roll: [-800, -700]}}}}
  w:
    _target_: {OSCAR_ACTORS}.Walker
    transform: {{rotation: {{yaw: [340, 390]}}}}
"""
    draws = {row.to.rpartition("values.")[2]: row.written for row in import_text(text).report.rows if "draw" in row.to}
    assert draws == {
        "sensors.c.mount.yaw": "[-10, 10]",
        "sensors.c.mount.pitch": "[-320, -300]",
        "sensors.c.mount.roll": "[-80, 20]",
        "actors.w.start.yaw": "[-30, 20]",
    }
