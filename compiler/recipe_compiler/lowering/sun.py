"""Position of the sun, from time and place or from CARLA's angles."""

from __future__ import annotations

import datetime

from recipe_compiler.ir.plan import Sun

PLACES = 2  # decimals of a degree: coarse enough to round away differences of libm between CPUs


def from_time(
    time: str, *, date: str, latitude: float, longitude: float, utc_offset: float | None
) -> tuple[float, float]:
    """Compute the position of the sun, without refraction, by the NOAA equations of the `astral` package.

    Args:
        time: local time, HH:MM or HH:MM:SS.
        date: YYYY-MM-DD.
        latitude: degrees north.
        longitude: degrees east.
        utc_offset: hours ahead of UTC. None means the nautical time zone, longitude / 15 rounded. Time-zone
            databases are not used, because they differ between hosts.

    Returns:
        Azimuth (counter-clockwise from +x, which is east) and altitude, both in degrees rounded to 0.01.

    Raises:
        ValueError: the date does not exist.
    """
    from astral import Observer
    from astral.sun import zenith_and_azimuth

    offset = float(round(longitude / 15.0)) if utc_offset is None else utc_offset
    local = datetime.datetime.fromisoformat(f"{date}T{time}")
    moment = (local - datetime.timedelta(hours=offset)).replace(tzinfo=datetime.timezone.utc)
    zenith, compass = zenith_and_azimuth(Observer(latitude, longitude), moment, with_refraction=False)
    return wrapped(90.0 - compass), round(90.0 - zenith, PLACES) + 0.0


def wrapped(azimuth: float) -> float:
    """Normalize an angle in degrees to [0, 360), rounded to 0.01."""
    return round(azimuth % 360.0, PLACES) % 360.0 + 0.0


def from_carla(azimuth: float, altitude: float) -> Sun:
    """Convert CARLA's sun angles, in degrees.

    CARLA's y axis points the other way, so its azimuth increases clockwise seen from above.
    """
    return Sun(azimuth=-azimuth % 360.0, altitude=altitude)
