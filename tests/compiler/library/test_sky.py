"""Weather presets, and the position of the sun."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.library import weather
from recipe_compiler.lowering import sun

from docs.tables import weather_parameters
from tests.compiler.kitchen import compiled, only, small


def test_presets_are_unchanged() -> None:
    """They are those of CARLA 0.9.16; another number would change every dataset whose recipe names the preset."""
    varied = [p for p in PARAMETERS if len({values[p] for values in weather.PRESETS.values()}) > 1]
    rows = [[name, *(values[p] for p in varied)] for name, values in weather.PRESETS.items()]
    assert digest("presets", rows)[:16] == "d1a19df2eb4e1174"


def test_unset_values_become_the_engines_defaults() -> None:
    default = weather.preset("Default")
    assert (default["sun_altitude_angle"], default["fog_falloff"]) == (75, 0.2)
    assert default["mie_scattering_scale"] == 0.03  # CARLA sets it
    assert weather.preset("ClearNoon")["sun_azimuth_angle"] == 0


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_has_a_range_and_changes_the_appearance_alone(name: str) -> None:
    declared = PARAMETERS[name]
    of_presets = [weather.preset(preset)[name] for preset in weather.PRESETS]
    assert all(declared.low <= value <= declared.high for value in (*of_presets, declared.engine, declared.constructor))
    middle = (declared.low + declared.high) / 2
    low, high = (only(small(weather={name: value})) for value in (declared.low, middle))
    assert (low.scene.digest, low.rig.digest) == (high.scene.digest, high.rig.digest)
    assert low.appearance.digest != high.appearance.digest
    for value in (declared.low - 1.5, declared.high + 1.5):
        with pytest.raises(InputError, match=rf"weather.{name}: .* write a value from"):
            compiled(small(weather={name: value}))


def test_no_weather_is_the_default_preset() -> None:
    recipe = small()
    del recipe["base"]["weather"]
    assert only(recipe).appearance == only(small(weather="Default")).appearance
    assert only(recipe).appearance == only(small(weather={})).appearance


def test_the_documentation_has_the_values_of_a_recipe_without_weather() -> None:
    recipe = small()
    del recipe["base"]["weather"]
    shown = {row.split("`")[1]: float(row.split(" | ")[2]) for row in weather_parameters().splitlines()[2:]}
    appearance = only(recipe).appearance
    sky = {"sun_azimuth_angle": -appearance.sun.azimuth % 360, "sun_altitude_angle": appearance.sun.altitude}
    assert shown == appearance.weather.model_dump() | sky


@pytest.mark.parametrize(("carla", "ours"), [(0, 0), (90, 270), (360, 0), (45.5, 314.5)])
def test_carlas_azimuth_is_clockwise(carla: float, ours: float) -> None:
    where = only(small(weather={"sun_azimuth_angle": carla, "sun_altitude_angle": 10})).appearance.sun
    assert (where.azimuth, where.altitude) == (ours, 10)


@pytest.mark.parametrize(
    ("time", "place", "azimuth", "altitude"),
    [
        # NOAA's solar calculator, without refraction
        ("12:00", {"date": "2022-06-21", "latitude": 40.0, "longitude": -105.0, "utc_offset": -7}, 272.2, 73.4),
        ("12:00", {"date": "2022-03-20", "latitude": 0.0, "longitude": 0.0, "utc_offset": 0}, None, 88.1),
        ("09:00", {"date": "2022-12-21", "latitude": -33.9, "longitude": 151.2, "utc_offset": 10}, None, 50.6),
    ],
)
def test_sun_from_time_and_place(time: str, place: dict[str, float], azimuth: float | None, altitude: float) -> None:
    where = only(small(time=time, place=place)).appearance.sun
    assert where.altitude == pytest.approx(altitude, abs=0.4)
    if azimuth is not None:
        assert where.azimuth == pytest.approx(azimuth, abs=2.0)


def test_morning_sun_is_in_the_east_and_evening_sun_in_the_west() -> None:
    morning, evening = (only(small(time=time)).appearance.sun for time in ("07:00", "19:00"))
    assert min(morning.azimuth, 360 - morning.azimuth) < 40  # +x is east
    assert 140 < evening.azimuth < 220
    assert 0 < evening.altitude < 15


def test_the_default_place_has_day_dusk_and_night() -> None:
    noon, dusk, night = (only(small(time=time)).appearance.sun.altitude for time in ("12:00", "19:40", "23:30"))
    assert noon > 50 and -3 < dusk < 3 and night < -18


def test_the_suns_position_is_rounded_to_a_hundredth_of_a_degree() -> None:
    azimuth, altitude = sun.from_time("10:17", date="2022-08-12", latitude=49.0, longitude=8.0, utc_offset=None)
    assert (azimuth, altitude) == (round(azimuth, 2), round(altitude, 2))
    assert sun.wrapped(-0.001) == 0.0 and sun.wrapped(359.999) == 0.0


def test_an_explicit_angle_overrides_time_and_time_overrides_a_preset() -> None:
    reported = only(small(time="15:00")).appearance.sun
    by_hand = only(small(time="15:00", weather={"preset": "ClearSunset", "sun_altitude_angle": 10})).appearance.sun
    assert (by_hand.azimuth, by_hand.altitude) == (reported.azimuth, 10)
    assert only(small(time="15:00", weather="ClearSunset")).appearance.sun == reported


@pytest.mark.parametrize(
    ("weather_", "time", "warns"),
    [
        ("ClearNight", "12:00", True),
        ({"preset": "WetNight", "fog_density": 20}, "15:00", True),
        ("ClearSunset", "19:40", False),
        ("ClearNoon", "19:40", False),  # as in the recipe of `recipe init`
        ({"preset": "ClearNight", "sun_altitude_angle": -90}, "23:00", True),  # the warning about the angle, alone
    ],
)
def test_a_dark_preset_with_a_time_of_day_causes_a_warning(weather_: object, time: str, warns: bool) -> None:
    """Otherwise, a variant `weather=night` of a recipe with a time would have pictures of noon without notice."""
    found = compiled(small(weather=weather_, time=time)).warnings
    assert [problem.code for problem in found] == [Code.OVERRIDDEN] * warns
    if warns and not (isinstance(weather_, dict) and "sun_altitude_angle" in weather_):
        (problem,) = found
        name = weather_["preset"] if isinstance(weather_, dict) else weather_
        assert f'time "{time}" of line ' in problem.message
        assert f'overrides the sun of the preset "{name}", so it is day' in problem.message
