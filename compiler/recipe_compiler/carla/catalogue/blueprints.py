"""CARLA's blueprints, as of 0.9.16, and the most similar ones of the library."""

from __future__ import annotations

from fnmatch import fnmatchcase

from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints

_VEHICLES = {
    "vehicle.hatchback.*": "audi.a2 citroen.c3 micro.microlino mini.cooper_s mini.cooper_s_2021 nissan.micra seat.leon",
    "vehicle.sedan.*": "audi.tt bmw.grandtourer chevrolet.impala dodge.charger_2020 dodge.charger_police"
    " dodge.charger_police_2020 ford.mustang lincoln.mkz_2017 lincoln.mkz_2020 mercedes.coupe mercedes.coupe_2020"
    " tesla.model3 toyota.prius",
    "vehicle.sedan.taxi": "ford.crown",
    "vehicle.suv.*": "audi.etron jeep.wrangler_rubicon nissan.patrol nissan.patrol_2021",
    "vehicle.pickup.*": "tesla.cybertruck",
    "vehicle.van.*": "volkswagen.t2 volkswagen.t2_2021",
    "vehicle.van.cargo": "ford.ambulance mercedes.sprinter",
    "vehicle.bus.*": "mitsubishi.fusorosa",
    "vehicle.truck.*": "carlamotors.carlacola carlamotors.european_hgv carlamotors.firetruck",
    "vehicle.motorcycle.*": "harley-davidson.low_rider kawasaki.ninja yamaha.yzf",
    "vehicle.scooter.*": "vespa.zx125",
    "vehicle.bicycle.*": "bh.crossbike diamondback.century gazelle.omafiets",
}
_CLOSEST = {f"vehicle.{name}": glob for glob, names in _VEHICLES.items() for name in names.split()}
_CHILDREN = (9, 10, 11, 12, 13, 14, 48, 49)  # numbers of CARLA's pedestrians that are children
_CLOSEST |= {f"walker.pedestrian.{number:04d}": "" for number in range(1, 53)}


def closest_match(name: str, kind: str, seed: int, actor: str) -> tuple[str, str] | None:
    """Return the most similar blueprint or glob of the library.

    Args:
        name: CARLA's blueprint or glob.
        kind: `walker` or `vehicle`.
        seed: the recipe's seed.
        actor: the actor's name; seed and name select one of several blueprints that match.

    Returns:
        The library's blueprint or glob, and the reason if it differs, else an empty text; None if CARLA has no such
        blueprint.
    """
    number = name.removeprefix("walker.pedestrian.")
    if number != name and number.isdigit():
        return _person(int(number)), "the library's people differ from CARLA's; this one has the same age"
    found = blueprints.match(name)
    if found and all(each.id.startswith(f"{kind}.") for each in found):
        return name, ""
    matches = sorted(each for each in _CLOSEST if fnmatchcase(each, name) and each.startswith(f"{kind}."))
    if not matches:
        return None
    chosen = Stream(seed, "carla", actor, "blueprint").choice(matches)
    several = f", one of {len(matches)} that match, chosen by seed and name" if len(matches) > 1 else ""
    if kind == "walker":
        return _person(int(chosen.rsplit(".", 1)[1])), f"{chosen}{several}: another person of that age in the library"
    return _CLOSEST[chosen], f"{chosen}{several}: vehicles of that kind in the library"


def _person(number: int) -> str:
    """Return a pedestrian of the library for CARLA's number: of the same age and, if possible, the same number."""
    age, name = "child" if number in _CHILDREN else "adult", f"walker.pedestrian.{number:04d}"
    alike = [each.id for each in blueprints.match("walker.pedestrian.*") if each.attributes["generation"] == age]
    return name if name in alike else alike[number % len(alike)]
