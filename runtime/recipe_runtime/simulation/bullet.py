"""Adapter to PyBullet, the only module that imports it: creates, steps and reads a world.

Every engine parameter is set explicitly. Bodies never sleep, no body is removed, and no state is restored. Each island
of touching bodies is solved separately. A pedestrian is a capsule and a vehicle a box on four spheres; their velocity
is set before each step, and contacts then change it. Limbs and visible wheels do not collide: `body.kinematics` poses
them. Importing this module prints PyBullet's build line, so it is imported only in processes whose standard output is
redirected (see `simulation.process`).
"""

from __future__ import annotations

from collections.abc import Sequence

import pybullet
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Element, Pose, PropPlan, TownPlan

from recipe_runtime.body.kinematics import Quaternion, Vector
from recipe_runtime.body.skeleton import wheel_joints
from recipe_runtime.meshes.roads import outline
from recipe_runtime.simulation.terrain import Ground

GRAVITY = 9.81
# Elements with a box collider about their base centre. A billboard's panel is above head height, so it has none.
_SOLID = {"bench", "bin", "bollard", "bus_stop", "bush", "fence", "fountain"}
_SOLID |= {"guardrail", "hedge", "hydrant", "kiosk", "lamp", "planter", "statue", "tower", "traffic_light"}
_GROUND, _OBSTACLE, _ACTOR, _WHEEL = 1, 2, 4, 8  # collision groups


def _quaternion(pose: Pose) -> Quaternion:
    """Orientation of a pose (x, y, z, w): roll, then pitch, then yaw about fixed axes."""
    sy, cy = exact.sin_cos_deg(pose.yaw / 2)
    sp, cp = exact.sin_cos_deg(pose.pitch / 2)
    sr, cr = exact.sin_cos_deg(pose.roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def _centre_and_size(prop: PropPlan) -> tuple[Vector, Vector]:
    """Return the centre and the size of a prop's box in its own frame, metres; each extent is at least 1 mm."""
    (a, b, c), (d, e, f) = prop.low, prop.high
    return ((a + d) / 2, (b + e) / 2, (c + f) / 2), (max(d - a, 0.001), max(e - b, 0.001), max(f - c, 0.001))


class World:
    """A physics world in a PyBullet client of its own.

    Bodies are added in plan order; positions are in metres in the world frame, velocities in m/s and rad/s.
    """

    def __init__(self, town: TownPlan, steps_per_second: int, props: Sequence[PropPlan] = ()) -> None:
        self.ground = Ground(town)
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.resetSimulation(physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / steps_per_second,
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
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=self._client)
        self._add_fixed(
            pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client), Pose(), _GROUND
        )
        for element in town.elements:
            self._add_element(element)
        for prop in props:  # collides as its bounding box
            centre, size = _centre_and_size(prop)
            self._add_fixed(self._box(centre, size), prop.pose, _OBSTACLE)

    def close(self) -> None:
        """Disconnect the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def step(self) -> None:
        """Advance by one step."""
        pybullet.stepSimulation(physicsClientId=self._client)

    def base(self, body: int) -> tuple[Vector, Quaternion]:
        """Position and orientation of a body's base part."""
        position, orientation = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        return position, orientation

    def velocity(self, body: int) -> tuple[Vector, Vector]:
        """Linear and angular velocity of a body's base part."""
        linear, angular = pybullet.getBaseVelocity(body, physicsClientId=self._client)
        return linear, angular

    def set_velocity(self, body: int, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Set the linear and angular velocity of a body's base part."""
        pybullet.resetBaseVelocity(body, linear, angular, physicsClientId=self._client)

    def add_pedestrian(self, actor: ActorPlan) -> int:
        """Add a pedestrian, a capsule from the shins up, and return its body id."""
        height = actor.shape["height"]
        radius, low = 0.13 * height, 0.22 * height
        length = height - low - 2 * radius
        capsule = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=radius,
            height=length,
            collisionFramePosition=(0.0, 0.0, low + radius + length / 2),
            physicsClientId=self._client,
        )
        body = self._multibody(actor.start, 70.0, capsule, (), -1)
        self._filter(body, -1, _ACTOR, _OBSTACLE | _ACTOR)
        pybullet.changeDynamics(body, -1, localInertiaDiagonal=(60.0, 60.0, 20.0), physicsClientId=self._client)
        return body

    def add_vehicle(self, actor: ActorPlan, *, fixed: bool = False) -> int:
        """Add a vehicle and return its body id.

        A vehicle is a box on four spheres that collide with the ground only; a `fixed` one is a static box.
        """
        shape = actor.shape
        low, high = shape["clearance"] + 0.1, min(shape["height"], 3.2)
        box = pybullet.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=(shape["length"] / 2, shape["width"] / 2, (high - low) / 2),
            collisionFramePosition=(0.0, 0.0, (high + low) / 2),
            physicsClientId=self._client,
        )
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=shape["wheel"], physicsClientId=self._client)
        places = [joint.offset for joint in wheel_joints(shape)]
        if fixed:
            body = self._multibody(actor.start, 0.0, box, (), -1)
            self._filter(body, -1, _ACTOR, _ACTOR)
            return body
        body = self._multibody(actor.start, 1500.0, box, places, ball)
        self._filter(body, -1, _ACTOR, _OBSTACLE | _ACTOR)
        for link in range(len(places)):
            self._filter(body, link, _WHEEL, _GROUND)
        pybullet.changeDynamics(body, -1, localInertiaDiagonal=(800.0, 2500.0, 2500.0), physicsClientId=self._client)
        return body

    def _multibody(self, start: Pose, mass: float, shape: int, places: Sequence[Vector], foot: int) -> int:
        """Create a base with fixed links. Each link's origin is its centre of mass; the base's is on the ground."""
        count = len(places)
        body: int = pybullet.createMultiBody(
            baseMass=mass,
            baseCollisionShapeIndex=shape,
            basePosition=(start.x, start.y, start.z),
            baseOrientation=_quaternion(start),
            linkMasses=[0.05] * count,
            linkCollisionShapeIndices=[foot] * count,
            linkVisualShapeIndices=[-1] * count,
            linkPositions=list(places),
            linkOrientations=[(0.0, 0.0, 0.0, 1.0)] * count,
            linkInertialFramePositions=[(0.0, 0.0, 0.0)] * count,
            linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)] * count,
            linkParentIndices=[0] * count,
            linkJointTypes=[pybullet.JOINT_FIXED] * count,
            linkJointAxis=[(0, 0, 1)] * count,
            physicsClientId=self._client,
        )
        for link in range(-1, count):
            pybullet.changeDynamics(
                body,
                link,
                lateralFriction=0.0,
                spinningFriction=0.0,
                rollingFriction=0.0,
                restitution=0.0,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
                physicsClientId=self._client,
            )
            if link >= 0:
                pybullet.changeDynamics(
                    body, link, localInertiaDiagonal=(0.001, 0.001, 0.001), physicsClientId=self._client
                )
        return body

    def _add_element(self, element: Element) -> None:
        x, y, z = element.size
        if element.kind == "sidewalk":
            self._add_fixed(self._slab(x, y, z, element.shape["radius"]), element.pose, _GROUND)
        elif element.kind in ("building", "house", "wall"):
            self._add_fixed(self._box((-x / 2, 0.0, z / 2), (x, y, z)), element.pose, _OBSTACLE)
        elif element.kind in _SOLID:
            self._add_fixed(self._box((0.0, 0.0, z / 2), (x, y, z)), element.pose, _OBSTACLE)
        elif element.kind == "tree":
            thick = 2.2 * element.shape["trunk"]
            self._add_fixed(self._box((0.0, 0.0, z / 4), (thick, thick, z / 2)), element.pose, _OBSTACLE)

    def _box(self, centre: Vector, size: Vector) -> int:
        shape: int = pybullet.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=[s / 2 for s in size],
            collisionFramePosition=centre,
            physicsClientId=self._client,
        )
        return shape

    def _slab(self, x: float, y: float, top: float, radius: float) -> int:
        """Create the collider of a sidewalk: a prism with rounded corners."""
        ring = outline(x, y, radius, 0.0)
        vertices = [(px, py, z) for z in (-0.5, top) for px, py in ring]
        shape: int = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices, physicsClientId=self._client)
        return shape

    def _add_fixed(self, shape: int, pose: Pose, group: int) -> None:
        body = pybullet.createMultiBody(
            baseMass=0.0,
            baseCollisionShapeIndex=shape,
            basePosition=(pose.x, pose.y, pose.z),
            baseOrientation=_quaternion(pose),
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(body, -1, lateralFriction=0.0, restitution=0.0, physicsClientId=self._client)
        self._filter(body, -1, group, _ACTOR | _WHEEL)

    def _filter(self, body: int, link: int, group: int, mask: int) -> None:
        pybullet.setCollisionFilterGroupMask(body, link, group, mask, physicsClientId=self._client)
