"""CARLA's semantic tags (0.9.14 and later) that our geometry uses."""

from enum import IntEnum


class Tag(IntEnum):
    """Class of a surface, as `carla.CityObjectLabel` numbers it."""

    ROADS = 1
    SIDEWALKS = 2
    BUILDINGS = 3
    WALLS = 4
    FENCES = 5
    POLES = 6
    TRAFFIC_LIGHT = 7
    TRAFFIC_SIGNS = 8
    VEGETATION = 9
    TERRAIN = 10
    RIDER = 13
    STATIC = 20
    WATER = 23
    ROAD_LINES = 24
    GROUND = 25
    GUARD_RAIL = 28
