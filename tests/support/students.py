"""Engines of students: Algorithms 1 and 2 in plain NumPy, right, and with one mistake each, some of them made in several ways."""

import numpy as np

from dropspin.comparisons.engines.base import Engine, Simulation
from support.transcription import UP, cross_matrix, quaternion_product, rotation_matrix


class Student(Engine):
    """The method of the lecture note, and for a coefficient of friction the rule of its laboratory."""

    name = "student"

    def declines(self, scene):
        return (
            "bodies of vertices touch the floor"
            if scene.floor is not None and not scene.body.is_ball and scene.body.semi_axes.any()
            else None
        )

    def discretisation(self, scene):
        return "law note"

    def prepare(self, scene, dt):
        return type(self).simulation(scene, dt)


class Solver(Simulation):
    """One scene; each method is one line of the note, which a mistake replaces."""

    def __init__(self, scene, dt):
        self.dt, self.velocity_lag, self.settings = dt, 0.5 * dt, {"version": "1"}
        self.mass, self.inertia, self.points = scene.body.mass, scene.body.inertia_tensor, scene.body.hull
        self.radius = scene.body.semi_axes[1]
        self.gravity, self.floor = scene.acceleration, scene.floor
        rates = scene.damping.rates if scene.damping else {"linear": 0.0, "angular": 0.0}
        self.c_linear, self.c_angular = (np.exp(-rate * dt) for rate in rates.values())
        self.x, self.q, self.v, self.w = np.split(scene.initial_state, [3, 7, 10])
        self.restitution = scene.floor.restitution if scene.floor else 0.0

    def advance(self, steps):
        for _ in range(steps):
            self.v = self.c_linear * (self.v + self.dt * self.gravity)
            self.w = self.c_angular * self.w
            if self.floor is not None:
                self.collide()
            self.move()

    def move(self):
        self.x = self.x + self.dt * self.v
        self.turn()

    def state(self):
        return np.concatenate([self.x, self.q, self.v, self.w])

    def turn(self):
        self.q = self.normalised(self.q + 0.5 * self.dt * self.rate())

    def rate(self):
        return quaternion_product(np.append(self.w, 0.0), self.q)

    def normalised(self, q):
        return q / np.linalg.norm(q)

    def inverse_inertia(self, R):
        return np.linalg.inv(R @ self.inertia @ R.T)

    def inverse_in_k(self, R):
        return self.inverse_inertia(R)

    def collide(self):
        R = rotation_matrix(self.q)
        arms = self.points @ R.T - self.radius * UP
        hit = (self.x[1] + arms[:, 1] < 0.0) & ((self.v + np.cross(self.w, arms))[:, 1] < 0.0)
        if hit.any():
            r = arms[hit].mean(axis=0)
            r_star = cross_matrix(r)
            K = np.eye(3) / self.mass - r_star @ self.inverse_in_k(R) @ r_star
            u = self.v + np.cross(self.w, r)
            j = self.impulse(K, u, u @ UP)
            self.v = self.v + j / self.mass
            self.w = self.w + self.inverse_inertia(R) @ np.cross(r, j)

    def impulse(self, K, u, u_normal):
        slip = u - u_normal * UP
        return np.linalg.solve(K, self.wanted_normal(u_normal) * UP + self.wanted_slip(slip, u_normal))

    def wanted_normal(self, u_normal):
        return -(1.0 + self.restitution) * u_normal

    def wanted_slip(self, slip, u_normal):
        return -self.share(slip, u_normal) * slip

    def share(self, slip, u_normal):
        """What the impulse takes of the slip: 1 - a in the laboratory."""
        friction = self.floor.coefficient
        if friction in (0.0, np.inf):
            return float(friction > 0.0)
        return min(friction * (1.0 + self.restitution) * self.quotient(abs(u_normal), np.linalg.norm(slip)), 1.0)

    def quotient(self, normal, tangential):
        return normal / max(tangential, 1e-300)


def student(title="right", **methods):
    """An engine of a student whose solver has other methods."""
    solver = type("Mistaken", (Solver,), {"__doc__": title, **methods})
    return type("Mistaken", (Student,), {"name": "student", "simulation": solver, "__doc__": title})()
