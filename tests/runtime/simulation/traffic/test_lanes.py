"""Lane changes by MOBIL, overtaking on the oncoming lane, pedestrians, speed limits and bends."""

from __future__ import annotations

import math

import pytest
from recipe_compiler.ir.plan import ActorPlan, Clock, ScenePlan
from recipe_compiler.library import blueprints
from recipe_runtime.simulation.loop import Simulation
from recipe_runtime.simulation.path import Path, nearest_on
from recipe_runtime.simulation.traffic.following import style_of
from recipe_runtime.simulation.traffic.lane_change import KEEP_RIGHT, THRESHOLD, Neighbour, Own, catches_up, gain
from recipe_runtime.simulation.vehicle import VehicleAgent

from tests.runtime.simulation.traffic.kinematic_world import Dummy, KinematicWorld, actor
from tests.runtime.simulation.traffic.scenes import lane as scene_lane
from tests.runtime.simulation.traffic.scenes import motorway, street

CAR = style_of(blueprints.match("vehicle.sedan.a")[0].shape)
FAST = Own(30.0, 33.0, 4.5, CAR)


def _neighbour(gap: float, speed: float) -> Neighbour:
    return Neighbour(gap, speed, 33.0, CAR)


def test_mobil_changes_lanes_behind_a_slow_leader() -> None:
    assert gain(FAST, (_neighbour(40.0, 20.0), None), (None, None), left=True) > 1.0
    assert gain(FAST, (None, None), (_neighbour(40.0, 20.0), None), left=True) < 0.0


def test_mobil_never_makes_a_follower_brake_hard() -> None:
    slow = Own(20.0, 33.0, 4.5, CAR)
    blocked = (_neighbour(15.0, 15.0), None)
    assert gain(slow, blocked, (None, _neighbour(80.0, 20.0)), left=True) > 0.0
    assert gain(slow, blocked, (None, _neighbour(20.0, 33.0)), left=True) == -math.inf
    assert gain(slow, blocked, (None, _neighbour(3.0, 20.0)), left=True) == -math.inf  # no room


def test_mobil_considers_the_follower_in_the_left_lane() -> None:
    """Politeness: an advantage counts less if that follower has to brake, and more if it can accelerate."""
    here, behind = _neighbour(30.0, 24.0), _neighbour(30.0, 33.0)
    alone = gain(FAST, (here, None), (None, None), left=True)
    assert gain(FAST, (here, None), (None, _neighbour(60.0, 33.0)), left=True) < alone
    assert gain(FAST, (here, behind), (None, None), left=True) == alone
    freed = gain(FAST, (None, behind), (None, None), left=False)
    assert freed > gain(FAST, (None, None), (None, None), left=False) == 0.0
    assert gain(FAST, (None, behind), (None, _neighbour(60.0, 33.0)), left=False) == freed


def test_without_an_advantage_no_vehicle_changes_to_the_left() -> None:
    assert gain(FAST, (None, None), (None, None), left=True) - KEEP_RIGHT - THRESHOLD < 0.0
    assert (
        gain(FAST, (None, None), (None, None), left=False) + KEEP_RIGHT - THRESHOLD > 0.0
    )  # but it changes to the right


def test_a_slow_vehicle_does_not_move_to_the_left_for_its_follower() -> None:
    world = KinematicWorld(
        motorway(), [_on_motorway("truck", 2, -330.0, 15.0, "truck.box"), _on_motorway("car", 2, -400.0, 30.0)]
    )
    world["truck"].speed, world["car"].speed = 15.0, 30.0
    for _ in range(80):
        world.step()
        assert world["truck"].offset == 0.0
    assert world["car"].offset == pytest.approx(3.6, abs=0.1)


def _on_motorway(name: str, number: int, y: float, speed: float, kind: str = "sedan.a") -> ActorPlan:
    x = scene_lane(number)
    return actor(name, f"vehicle.{kind}", start=(x, y, 90.0), route=[(x, 780.0)], speed=speed)


def test_a_slow_truck_is_overtaken_on_three_lanes() -> None:
    plans = [_on_motorway("truck", 2, -300.0, 18.0, "truck.box"), _on_motorway("car", 2, -400.0, 30.0)]
    world = KinematicWorld(motorway(), plans)
    furthest = 0.0
    for _ in range(300):
        world.step()
        furthest = max(furthest, world["car"].offset)
        world.find_overlaps()
    assert world["car"].y > world["truck"].y + 40.0
    assert furthest == pytest.approx(3.6, abs=0.3)  # one full lane
    assert world["car"].offset == pytest.approx(0.0, abs=0.3)  # and back to the right
    assert not world.overlaps


def test_no_vehicle_changes_beyond_the_outer_lanes() -> None:
    plans = [_on_motorway(f"v{n}", n % 3, -300.0 + 14.0 * n, 18.0 + 5.0 * (n % 4)) for n in range(12)]
    world = KinematicWorld(motorway(), plans)
    middle = [scene_lane(n) for n in range(3)]
    for _ in range(250):
        world.step()
        for body in world.bodies:
            assert middle[0] - 0.3 < body.x < middle[2] + 0.3
        world.find_overlaps()
    assert not world.overlaps


def test_a_stopped_vehicle_blocks_one_lane_only() -> None:
    plans = [_on_motorway("broken", 1, 0.0, 0.0), _on_motorway("car", 1, -300.0, 28.0)]
    world = KinematicWorld(motorway(), plans)
    world.run(35.0)
    assert world["car"].y > 100.0 and not world.overlaps


def _east(name: str, x: float, kind: str = "sedan.a", speed: float | None = None) -> ActorPlan:
    return actor(name, f"vehicle.{kind}", start=(x, -1.5, 0.0), route=[(780.0, -1.5)], speed=speed)


def _west(name: str, x: float, speed: float | None = None) -> ActorPlan:
    return actor(name, start=(x, 1.5, 180.0), route=[(10.0, 1.5)], speed=speed)


def test_a_bicycle_keeps_right_and_is_overtaken_with_a_safe_distance() -> None:
    world = KinematicWorld(street(), [_east("bike", 60.0, "bicycle.a"), _east("car", 10.0, speed=11.0)])
    least = 10.0
    for _ in range(400):
        world.step()
        bike, car = world["bike"], world["car"]
        if abs(bike.x - car.x) < bike.reach + car.reach:
            least = min(least, abs(bike.y - car.y) - bike.radius - car.radius)
    assert world["bike"].y == pytest.approx(-2.3, abs=0.05)
    assert world["car"].x > world["bike"].x + 20.0
    assert 1.0 < least < 2.5
    assert world["car"].offset == pytest.approx(0.0, abs=0.05)


@pytest.mark.slow
def test_no_vehicle_overtakes_into_oncoming_traffic() -> None:
    column = [_west(f"on.{n}", 110.0 + 30.0 * n, speed=9.0) for n in range(10)]
    world = KinematicWorld(street(), [_east("bike", 60.0, "bicycle.a"), _east("car", 40.0, speed=11.0), *column])
    for _ in range(200):
        world.step()
        car = world["car"]
        if any(abs(b.x - car.x) < 25.0 for b in world.bodies if b.actor.name.startswith("on.")):
            assert car.offset < 0.6
        world.find_overlaps()
    world.run(40.0)
    assert not world.overlaps
    assert world["car"].x > world["bike"].x  # after they have passed


def test_overtaking_is_aborted_before_the_vehicles_are_side_by_side() -> None:
    """An oncoming vehicle appears when the car is already in the other lane: the car returns behind its leader."""
    world = KinematicWorld(
        street(), [_east("bike", 70.0, "bicycle.a"), _east("car", 40.0, speed=11.0), _west("on", 780.0)]
    )
    while world["car"].offset < 0.8:
        world.step()
        assert world.seconds < 30.0
    oncoming = world["on"]
    oncoming.progress, oncoming.speed = 780.0 - world["car"].x - 42.0, 9.0
    oncoming.place()
    world.run(12.0)
    assert not world.overlaps
    world.run(40.0)
    assert world["car"].x > world["bike"].x and not world.overlaps


def test_a_standing_vehicle_in_the_lane_is_passed() -> None:
    world = KinematicWorld(street(), [_east("stopped", 100.0, speed=0.0), _east("car", 20.0)])
    world.run(50.0)
    assert world["car"].x > 150.0 and not world.overlaps


def test_a_queue_at_a_stop_line_is_not_passed() -> None:
    """A vehicle behind a waiting one waits too."""
    plans = [_east("first", 60.0), _east("second", 50.0), _east("third", 30.0)]
    world = KinematicWorld(street(), plans)
    for _ in range(300):
        world.step()
        world["first"].progress, world["first"].speed = 0.0, 0.0
        world["first"].driver.stalled = False
        world["first"].place()
        assert abs(world["third"].offset) < 0.1
    assert not world.overlaps


def test_vehicles_stop_for_a_pedestrian_on_the_road() -> None:
    walker = actor("walker", "walker.pedestrian.0001", start=(60.0, -9.0, 90.0), route=[(60.0, 9.0)])
    world = KinematicWorld(street(), [_east("car", 20.0), walker])
    hardest = 0.0
    for _ in range(250):
        world.step()
        car, body = world["car"], world.walker("walker")
        hardest = min(hardest, car.acceleration)
        inside = abs(car.x - body.x) < car.reach + body.radius and abs(car.y - body.y) < car.radius + body.radius
        assert not inside or car.speed < 0.1
    assert world["car"].x > 100.0
    assert hardest > -6.0


def test_speed_respects_the_limit_and_bends() -> None:
    route = [
        (200.0, -1.5),
        *((200.0 + 8.0 * s, -9.5 + 8.0 * c) for s, c in ((0.5, 0.866), (0.866, 0.5))),
        (208.0, -150.0),
    ]
    plan = actor("car", start=(20.0, -1.5, 0.0), route=route, speed=20.0)
    world = KinematicWorld(street(), [plan])
    fastest = lateral = 0.0
    for _ in range(400):
        world.step()
        car = world["car"]
        fastest = max(fastest, car.speed)
        lateral = max(lateral, abs(car.path.curvature(car.progress)) * car.speed * car.speed)
        assert car.acceleration > -3.5
    assert 12.0 < fastest < 50.0 / 3.6 + 0.3
    assert lateral < 3.5


def test_projection_near_a_place_finds_the_right_leg() -> None:
    """A path that comes back beside itself: only the legs between the two arc lengths count."""
    path = Path([(0.0, 0.0), (50.0, 0.0), (50.0, 4.0), (0.0, 4.0)])
    assert path.length == 104.0
    assert nearest_on(path.window(0.0, 40.0), 20.0, 1.0) == (20.0, 1.0)
    assert nearest_on(path.window(60.0, 100.0), 20.0, 1.0) == (84.0, 3.0)
    assert nearest_on(path.window(0.0, 10.0), -5.0, 0.0) == (0.0, 5.0)
    assert nearest_on(path.window(60.0, 104.0), -5.0, 4.0, open_end=True) == (109.0, 0.0)
    assert path.tangent(52.0) == (0.0, 1.0)
    assert [leg[4] for leg in path.window(45.0, 53.0)] == [0.0, 50.0]


class _Crossing(Dummy):
    """A pedestrian with right of way over a road."""

    crossing: tuple[float, float, float, float] | None = None


@pytest.mark.parametrize(("x", "stops"), [(60.0, True), (28.0, False)])
def test_a_pedestrian_at_a_crossing_has_right_of_way(x: float, stops: bool) -> None:
    """A car stops for a pedestrian with right of way at the kerb if it can do so comfortably."""
    walker = _Crossing(actor("walker", "walker.pedestrian.0001", start=(x, -6.0, 90.0)))
    walker.crossing = (x, -5.3, x, 5.3)
    world = KinematicWorld(street(), [_east("car", 10.0)])
    world.bodies.append(walker)
    world["car"].speed = 9.0
    world.run(12.0)
    assert (world["car"].speed < 0.1 and world["car"].x + world["car"].reach < x - 1.0) == stops
    walker.y = 2.0  # beyond the lane
    world.run(12.0)
    assert world["car"].x > x + 10.0


def test_a_vehicle_returns_to_the_right_only_if_it_can_stay_there() -> None:
    """At 33 m/s, it reaches its headway of 1.1 s behind a vehicle at 23 m/s, 338.3 m ahead, in 30 s."""
    assert catches_up(FAST, _neighbour(338.3, 23.0)) == pytest.approx(30.0, abs=1e-3)
    assert catches_up(FAST, _neighbour(20.0, 34.0)) == catches_up(FAST, None) == math.inf
    ahead = [_on_motorway("slow", 2, 60.0, 20.0), _on_motorway("car", 1, -60.0, 30.0)]
    world = KinematicWorld(motorway(), ahead)
    world["slow"].speed, world["car"].speed = 20.0, 30.0
    while world["car"].y < world["slow"].y:
        assert world["car"].offset == 0.0
        world.step()
    world.run(15.0)
    assert world["car"].offset == pytest.approx(-3.6, abs=0.01)


def test_two_vehicles_do_not_change_into_the_same_place() -> None:
    """Side by side in the outer lanes, each behind a truck, with the lane between them free."""
    plans = [_on_motorway(f"truck.{n}", n, -260.0, 15.0, "truck.box") for n in (0, 2)]
    plans += [_on_motorway(f"car.{n}", n, -300.0, 25.0) for n in (0, 2)]
    world = KinematicWorld(motorway(), plans)
    for car in world.cars:
        car.speed = 15.0
    changed: list[str] = []
    for _ in range(80):
        world.step()
        world.find_overlaps()
        changed += [car.actor.name for car in world.cars if car.offset and car.actor.name not in changed]
    assert len(changed) == 1
    assert not world.overlaps


def test_a_lane_change_is_aborted_if_the_place_is_taken() -> None:
    plans = [_on_motorway("truck", 2, -230.0, 15.0, "truck.box"), _on_motorway("car", 2, -300.0, 30.0),
             _on_motorway("other", 1, -700.0, 25.0)]  # fmt: skip
    world = KinematicWorld(motorway(), plans)
    car, other = world["car"], world["other"]
    world["truck"].speed, car.speed = 15.0, 25.0
    while car.driver.offset == 0.0:
        world.step()
        assert world.seconds < 20.0
    other.progress, other.speed = car.y + 700.0, car.speed  # beside it
    other.place()
    furthest = 0.0
    for _ in range(50):
        world.step()
        furthest = max(furthest, car.offset)
    assert 0.1 < furthest < 1.3
    assert car.driver.offset == 0.0 and car.offset == pytest.approx(0.0, abs=0.01)


def test_a_vehicle_does_not_slide_sideways() -> None:
    """In the physics engine: a lane change of at most 1.5 m/s2, with the velocity along the heading."""
    plans = [_on_motorway("truck", 2, -280.0, 18.0, "truck.box"), _on_motorway("car", 2, -400.0, 30.0)]
    made = Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=motorway(), actors=tuple(plans)))
    car = made.agents[1]
    assert isinstance(car, VehicleAgent)
    for agent in made.agents:
        agent.start_moving()
    sideways, velocity, slip = [0.0], 0.0, 0.0
    while made.seconds < 12.0:
        made.advance()
        if made.step % 24 == 0:
            sideways.append((car.velocity[0] - velocity) / 0.1)
            velocity = car.velocity[0]
            (hx, hy), (vx, vy) = car.heading, car.velocity
            slip = max(slip, abs(vy * hx - vx * hy) / max(math.hypot(vx, vy), 1.0))
    assert car.offset > 3.0
    assert 0.5 < max(map(abs, sideways)) < 1.5
    assert slip < math.sin(math.radians(1.0))
    made.close()
