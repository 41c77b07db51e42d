"""The engine `my-engine`: rigid bodies in free flight, and balls that bounce, slide and roll on a floor.

The engine is a toy of a few lines of NumPy. Replace it by calls of your own engine: what `MyEngineBatch` reads from a scene, what
`advance` does, and what `states` returns. `dropspin conform my_engine:MyEngine` says whether the adapter is right.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import dropspin as ds

Array = NDArray[np.float64]


class MyEngine(ds.Engine):
    """Semi-implicit Euler, with one impulse for each contact."""

    name = "my-engine"  # in results
    order = 1.0  # claimed order of accuracy in free flight, which `dropspin run` verifies; leave it out for no claim
    # precision = np.float32  # if the state is in single precision; the default is np.float64
    # compiles = True  # with a JIT compiler (JAX, Warp, Numba): compilation is then timed separately, with its own time limits

    def declines(self, scene: ds.Scenario) -> str | None:
        """The reason why a scene is not simulated, a limit of the engine or of this adapter; None if it is."""
        if scene.damping is not None:
            return "damping is not modelled"
        if np.count_nonzero(scene.body.inertia_tensor) > 3:
            return "only principal axes of inertia are modelled"
        if scene.floor is not None and (scene.body.shape != "sphere" or np.ptp(np.diag(scene.body.inertia_tensor)) > 0.0):
            return "only balls of equal moments of inertia touch the floor"
        return None

    def prepare(self, scene: ds.Scenario, dt: float) -> ds.Simulation:
        """Build one world: here a batch of one. An engine without batches subclasses `ds.Simulation`, which has `state` for `states`."""
        return ds.OneWorld(scene, MyEngineBatch([scene], dt))

    def prepare_batch(self, members: Sequence[ds.Scenario], dt: float) -> ds.BatchSimulation:
        """Build many worlds that are stepped together; optional."""
        return MyEngineBatch(members, dt)


class MyEngineBatch(ds.BatchSimulation):
    """Worlds that differ in their initial states alone."""

    def __init__(self, members: Sequence[ds.Scenario], dt: float) -> None:
        scene = members[0]
        self.dt, self.gravity, self.floor = dt, scene.acceleration, scene.floor  # floor is None: there is none
        self.velocity_lag = 0.5 * dt  # semi-implicit Euler: velocity lags position by half a step
        self.settings = {"version": "0.1"}  # stored with the results: the version of the engine, and every setting that matters
        self.radius, self.mass, self.moments = scene.body.size, scene.body.mass, np.diag(scene.body.inertia_tensor)
        starts = np.array([member.initial_state for member in members])
        self.x, self.q, self.v, self.w = np.split(starts, [3, 7, 10], axis=1)  # q is [x, y, z, w]; all in the world frame, y up
        # With a JIT compiler: call the compiled step once here, on a copy of the state, so that `advance` does not compile. Let the number
        # of steps be a variable, and keep the compiled function in the module, so that another simulation compiles nothing anew.

    def advance(self, steps: int) -> None:
        """Take time steps, and do nothing else: this is timed."""
        for _ in range(steps):
            self.v = self.v + self.dt * self.gravity
            self.w = self.w + self.dt * self.gyroscopic_acceleration()
            if self.floor is not None:
                hit = (self.x[:, 1] < self.radius) & (self.v[:, 1] < 0.0)
                if hit.any():
                    self.collide(hit, self.floor.restitution, self.floor.coefficient, self.floor.rest_speed)
            self.x = self.x + self.dt * self.v
            turned = self.q + 0.5 * self.dt * product(self.w, self.q)
            self.q = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        # An engine that computes asynchronously waits here until the states are there (JAX: block_until_ready; Warp: wp.synchronize).

    def gyroscopic_acceleration(self) -> Array:
        """Angular acceleration without torque, by Euler's equations [rad/s²], shape (size, 3)."""
        w = rotated(self.w, self.q * [-1.0, -1.0, -1.0, 1.0])  # in the body frame
        return rotated(cross(self.moments * w, w) / self.moments, self.q)

    def collide(self, hit: NDArray[np.bool_], restitution: float, friction: float, rest_speed: float) -> None:
        """Apply the impulses of the floor: Newton's restitution, and Coulomb friction against the slip of the contact point."""
        v, w, arm, moment = self.v[hit], self.w[hit], np.array([[0.0, -self.radius, 0.0]]), self.moments[0]
        normal = -self.mass * v[:, 1] * (1.0 + np.where(-v[:, 1] >= rest_speed, restitution, 0.0))
        slip = (v + cross(w, arm)) * [1.0, 0.0, 1.0]
        speed = np.linalg.norm(slip, axis=1)
        sticking = speed / (1.0 / self.mass + self.radius**2 / moment)  # the impulse that ends the slip
        tangential = np.minimum(friction * normal, sticking)  # friction is a Coulomb coefficient, inf on a floor that never lets slip
        impulse = -slip * (tangential / np.where(speed > 0.0, speed, 1.0))[:, None]
        impulse[:, 1] = normal
        self.v[hit] += impulse / self.mass
        self.w[hit] += cross(arm, impulse) / moment

    def states(self) -> Array:
        """Position, orientation, velocity and angular velocity, shape (size, 13), in memory of the processor, not of a GPU."""
        return np.concatenate([self.x, self.q, self.v, self.w], axis=1)

    def as_built(self) -> ds.AsBuilt:
        """The mass, inertia and gravity that the engine has, which are compared with the scene; optional."""
        return ds.AsBuilt(self.mass, np.diag(self.moments), self.gravity)


def product(w: Array, q: Array) -> Array:
    """Products of quaternions (w, 0) and q, [x, y, z, w] each, shape (size, 4)."""
    return np.column_stack([q[:, 3:] * w + cross(w, q[:, :3]), -np.sum(w * q[:, :3], axis=1)])


def rotated(v: Array, q: Array) -> Array:
    """Vectors, shape (size, 3), rotated by unit quaternions, shape (size, 4)."""
    twice = 2.0 * cross(q[:, :3], v)
    return v + q[:, 3:] * twice + cross(q[:, :3], twice)


def cross(a: Array, b: Array) -> Array:
    """Cross products, shape (size, 3); in few rows faster than numpy.cross."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
