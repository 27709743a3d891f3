"""Adapter to PyBullet, the only module that imports it: creates, steps and reads a world.

Actors and obstacles are colliders in a horizontal plane: upright prisms of one height around z = 0, so that every
contact is horizontal and nothing is lifted. A vehicle is a box with the mass of its kind, a parked one a static box, a
pedestrian a sphere, and an obstacle the outline of its box. There is no gravity and no ground: the control loop sets
velocities, and computes height, pitch and roll from the ground (`simulation.chassis`).

A step costs time for every body, also for those that stand still. Upright obstacles near each other therefore form one
body of several boxes.

Every engine parameter is set explicitly. Bodies never sleep, no body is removed, and no state is restored. Each island
of touching bodies is solved separately. Importing this module prints PyBullet's build line, so it is imported only in
processes whose standard output is redirected (see `simulation.process`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pybullet
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Element, Pose, PropPlan, TownPlan
from recipe_compiler.ir.plan_bounds import POSE, SITTING

from recipe_runtime.body.kinematics import Quaternion, Vector, rotate
from recipe_runtime.simulation.boxes import Box, neighbourhoods
from recipe_runtime.simulation.terrain import Ground

PlanarState = tuple[float, float, float, float, float, float, float]

# Elements with a box collider about their base centre. A billboard's panel is above head height, so it has none.
_SOLID = {"bench", "bin", "bollard", "bus_stop", "bush", "fence", "fountain"}
_SOLID |= {
    "bicycles",
    "board",
    "cafe",
    "delivery",
    "letter_box",
    "guardrail",
    "hedge",
    "hydrant",
    "kiosk",
    "lamp",
    "planter",
    "statue",
    "tower",
    "traffic_light",
}
_OBSTACLE, _ACTOR, _PARKED, _OVERHEAD = 1, 2, 4, 8  # collision groups
_HALF_HEIGHT, _THINNEST = 1.0, 0.001  # metres, of every collider
_MOST_SHAPES = 16  # maximum number of shapes that PyBullet combines in a body
_STEP_OVER, _HEADROOM, _CLEAR = 0.25, 1.9, 3.2  # metres: heights to step over, to walk under, and to drive under
_TILTING_INERTIA = 1e12  # kg m2: bodies rotate only about the vertical
_AWAY, _SPACING = -1000.0, 20.0  # metres: height of absent bodies, and the distance between them


def orientation(pose: Pose) -> Quaternion:
    """Return the orientation of a pose (x, y, z, w): roll, then pitch, then yaw about fixed axes."""
    sy, cy = exact.sin_cos_deg(pose.yaw / 2)
    sp, cp = exact.sin_cos_deg(pose.pitch / 2)
    sr, cr = exact.sin_cos_deg(pose.roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


class World:
    """A physics world in a PyBullet client of its own.

    Bodies are added in plan order; positions are in metres in the world frame, velocities in m/s and rad/s.
    """

    def __init__(self, town: TownPlan, steps_per_second: int, props: Sequence[PropPlan] = ()) -> None:
        self.ground = Ground(town)
        self.dt = 1.0 / steps_per_second
        self.names: dict[int, str] = {}  # collider -> name of the actor, element or prop
        self._joined: dict[int, Sequence[tuple[int, Box]]] = {}  # body -> its colliders, if it has several
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.resetSimulation(physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.dt,
            numSubSteps=0,
            numSolverIterations=30,
            solverResidualThreshold=0.0,
            constraintSolverType=pybullet.CONSTRAINT_SOLVER_LCP_SI,
            minimumSolverIslandSize=1,
            useSplitImpulse=0,
            splitImpulsePenetrationThreshold=-0.02,
            collisionFilterMode=0,
            contactBreakingThreshold=0.02,
            contactSlop=0.0,
            maxNumCmdPer1ms=0,
            enableFileCaching=0,
            restitutionVelocityThreshold=0.5,
            erp=0.2,
            contactERP=0.2,
            frictionERP=0.2,
            globalCFM=0.0,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            allowedCcdPenetration=0.0,
            jointFeedbackMode=0,
            enableSAT=0,
            reportSolverAnalytics=0,
            physicsClientId=self._client,
        )
        pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=self._client)
        boxes: dict[int, list[Box]] = {_OBSTACLE: [], _OVERHEAD: []}
        for element in town.elements:
            self._add_element(element, boxes)
        for prop in props:  # collides as its bounding box
            self._add_obstacle(prop.name, prop.pose, (prop.low, prop.high), boxes)
        for group, upright in boxes.items():
            for near in neighbourhoods(upright, _MOST_SHAPES):
                self._join(near, group)

    def close(self) -> None:
        """Disconnect the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def step(self) -> None:
        """Advance by one step."""
        pybullet.stepSimulation(physicsClientId=self._client)

    def state(self, body: int) -> PlanarState:
        """Return x, y, the unit vector (x, y) of the heading, the velocity (x, y), and the yaw rate of a body."""
        (x, y, _), (_, _, sine, cosine) = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        (vx, vy, _), (_, _, yaw_rate) = pybullet.getBaseVelocity(body, physicsClientId=self._client)
        return x, y, 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine, vx, vy, yaw_rate

    def set_velocity(self, body: int, vx: float, vy: float, yaw_rate: float) -> None:
        """Set the velocity of a body."""
        pybullet.resetBaseVelocity(body, (vx, vy, 0.0), (0.0, 0.0, yaw_rate), physicsClientId=self._client)

    def place(self, body: int, x: float, y: float, rotation: Quaternion) -> None:
        """Move a body to a position and a rotation about the vertical, at rest."""
        self._reset(body, (x, y, 0.0), rotation)

    def remove(self, body: int) -> Vector:
        """Move a body out of the scene, at rest, to a position of its own below the ground; return that position."""
        place = (_SPACING * body, 0.0, _AWAY)
        self._reset(body, place, (0.0, 0.0, 0.0, 1.0))
        return place

    def _reset(self, body: int, position: Vector, rotation: Quaternion) -> None:
        pybullet.resetBasePositionAndOrientation(body, position, rotation, physicsClientId=self._client)
        self.set_velocity(body, 0.0, 0.0, 0.0)

    def contacts(self) -> Iterator[tuple[int, int, float]]:
        """Yield the two colliders and the impulse (N s) of every contact point that carried load in the last step.

        The collider of an actor is its body; those of obstacles are negative.
        """
        for point in pybullet.getContactPoints(physicsClientId=self._client):
            if point[9] > 0.0:
                first, second = self._collider(point[1], point[5]), self._collider(point[2], point[6])
                yield first, second, point[9] * self.dt

    def _collider(self, body: int, at: Vector) -> int:
        """Return the collider of a body to which a contact point belongs."""
        joined = self._joined.get(body)
        return body if joined is None else min(joined, key=lambda entry: entry[1].distance(at[0], at[1]))[0]

    def add_pedestrian(self, actor: ActorPlan, radius: float, mass: float) -> int:
        """Add a pedestrian and return its body id."""
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius, physicsClientId=self._client)
        inertia = 0.5 * mass * radius * radius
        sits = actor.shape.get(POSE) == SITTING  # in a seat, which is an obstacle to others
        mask = _ACTOR if sits else _OBSTACLE | _ACTOR | _PARKED
        return self._add_actor(actor, shape, 0.0 if sits else mass, inertia, friction=0.0, mask=mask)

    def add_vehicle(self, actor: ActorPlan, mass: float, inertia: float) -> int:
        """Add a vehicle and return its body id.

        Args:
            actor: The vehicle.
            mass: kg; 0 for one that never moves.
            inertia: kg m2 about the vertical.
        """
        size = actor.shape
        overhead = _OVERHEAD if size["height"] > 2.2 else 0
        return self._add_actor(
            actor,
            self._box(size["length"], size["width"]),
            mass,
            inertia,
            friction=0.5,
            mask=_OBSTACLE | _ACTOR | _PARKED | overhead if mass > 0.0 else _ACTOR,
        )

    def _add_actor(
        self, actor: ActorPlan, shape: int, mass: float, inertia: float, *, friction: float, mask: int
    ) -> int:
        start = Pose(x=actor.start.x, y=actor.start.y, yaw=actor.start.yaw)
        body = self._add_body(actor.name, shape, mass, (start.x, start.y, 0.0), orientation(start), friction)
        if mass > 0.0:
            pybullet.changeDynamics(
                body,
                -1,
                mass=mass,  # PyBullet takes 0 for it if only the inertia is given
                localInertiaDiagonal=(_TILTING_INERTIA, _TILTING_INERTIA, inertia),
                linearDamping=0.0,
                angularDamping=0.0,
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
                physicsClientId=self._client,
            )
        self._filter(body, _ACTOR if mass > 0.0 else _PARKED, mask)
        return body

    def _add_element(self, element: Element, boxes: dict[int, list[Box]]) -> None:
        x, y, z = element.size
        if element.kind in ("building", "house", "wall"):
            extent = (-x, -y / 2, 0.0), (0.0, y / 2, z)
        elif element.kind in _SOLID:
            extent = (-x / 2, -y / 2, 0.0), (x / 2, y / 2, z)
        elif element.kind == "tree":
            thick = 1.1 * element.shape["trunk"]
            extent = (-thick, -thick, 0.0), (thick, thick, z / 2)
        else:
            return
        self._add_obstacle(element.name, element.pose, extent, boxes)

    def _add_obstacle(self, name: str, pose: Pose, extent: tuple[Vector, Vector], boxes: dict[int, list[Box]]) -> None:
        """Add the outline, seen from above, of a box in a pose, unless all actors pass under or over it.

        Args:
            name: Of the element or prop.
            pose: Its pose.
            extent: The box's lowest and highest coordinates in that pose.
            boxes: For each collision group the upright boxes, to which it is added if it is upright.
        """
        low, high = extent
        turn = orientation(pose)
        corners = [
            rotate(turn, (x, y, z)) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
        ]
        floor = self.ground.height(pose.x, pose.y)
        bottom, top = (f(corner[2] for corner in corners) + pose.z for f in (min, max))
        if top - floor < _STEP_OVER or bottom - floor > _CLEAR:
            return
        group = _OBSTACLE if bottom - floor < _HEADROOM else _OVERHEAD
        if pose.pitch == 0.0 and pose.roll == 0.0:
            dx, dy, _ = rotate(turn, ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0))
            half = (max(high[0] - low[0], _THINNEST) / 2, max(high[1] - low[1], _THINNEST) / 2)
            boxes[group].append(Box(name, (pose.x + dx, pose.y + dy), turn, half))
        else:
            body = self._add_body(name, self._prism(corners), 0.0, (pose.x, pose.y, 0.0), (0.0, 0.0, 0.0, 1.0), 0.5)
            self._filter(body, group, _ACTOR)

    def _join(self, boxes: Sequence[Box], group: int) -> None:
        """Add a body of several boxes that never moves."""
        x, y = boxes[0].place
        shape = pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
            halfExtents=[(*box.half, _HALF_HEIGHT) for box in boxes],
            collisionFramePositions=[(box.place[0] - x, box.place[1] - y, 0.0) for box in boxes],
            collisionFrameOrientations=[box.rotation for box in boxes],
            physicsClientId=self._client,
        )
        body = self._add_body("", shape, 0.0, (x, y, 0.0), (0.0, 0.0, 0.0, 1.0), 0.5)
        self._filter(body, group, _ACTOR)
        del self.names[body]
        first = -1 - len(self.names)
        self._joined[body] = [(first - number, box) for number, box in enumerate(boxes)]
        self.names.update((collider, box.name) for collider, box in self._joined[body])

    def _add_body(
        self, name: str, shape: int, mass: float, position: Vector, rotation: Quaternion, friction: float
    ) -> int:
        body: int = pybullet.createMultiBody(
            baseMass=mass,
            baseCollisionShapeIndex=shape,
            basePosition=position,
            baseOrientation=rotation,
            useMaximalCoordinates=True,  # a rigid body, which is faster than a tree of links
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            physicsClientId=self._client,
        )
        self.names[body] = name
        return body

    def _box(self, x: float, y: float) -> int:
        """Create an upright box."""
        half = (max(x, _THINNEST) / 2, max(y, _THINNEST) / 2, _HALF_HEIGHT)
        shape: int = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        return shape

    def _prism(self, corners: Sequence[Vector]) -> int:
        """Create the upright prism over the convex hull of points seen from above."""
        vertices = [(x, y, z) for z in (-_HALF_HEIGHT, _HALF_HEIGHT) for x, y, _ in corners]
        shape: int = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices, physicsClientId=self._client)
        return shape

    def _filter(self, body: int, group: int, mask: int) -> None:
        pybullet.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=self._client)
