"""Where the sun stands: from time and place, and from CARLA's angles."""

from __future__ import annotations

import datetime

from recipe_compiler.ir.plan import Sun

PLACES = 2  # decimals of a degree; coarse enough to hide the last bits of libm, which differ between CPUs


def from_time(
    time: str, *, date: str, latitude: float, longitude: float, utc_offset: float | None
) -> tuple[float, float]:
    """Azimuth (counter-clockwise from world +x, which is east) and altitude of the sun, in degrees, to 0.01.

    The position is geometric, without refraction, by the NOAA equations of the `astral` package. `time` is HH:MM or
    HH:MM:SS, `utc_offset` hours ahead of UTC; without it the zone is the nautical one, longitude / 15 rounded. No
    time-zone database is asked: hosts differ in theirs. ValueError if the date does not exist.
    """
    from astral import Observer
    from astral.sun import zenith_and_azimuth

    offset = float(round(longitude / 15.0)) if utc_offset is None else utc_offset
    local = datetime.datetime.fromisoformat(f"{date}T{time}")
    moment = (local - datetime.timedelta(hours=offset)).replace(tzinfo=datetime.timezone.utc)
    zenith, compass = zenith_and_azimuth(Observer(latitude, longitude), moment, with_refraction=False)
    return wrapped(90.0 - compass), round(90.0 - zenith, PLACES) + 0.0


def wrapped(azimuth: float) -> float:
    """An angle in degrees as one in [0, 360), to 0.01."""
    return round(azimuth % 360.0, PLACES) % 360.0 + 0.0


def from_carla(azimuth: float, altitude: float) -> Sun:
    """The sun at CARLA's angles: its azimuth runs clockwise, seen from above, for its y axis points the other way."""
    return Sun(azimuth=-azimuth % 360.0, altitude=altitude)
