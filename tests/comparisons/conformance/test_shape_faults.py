"""Faults of shapes, planted in a real engine, are named in words; engines without the shapes decline the checks."""

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.conformance.checks import run_check
from dropspin.comparisons.engines import mujoco_model
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.arguments import EngineEntry

KINDS = mujoco_model.mujoco.mjtGeom
ROOT = np.sqrt(0.5)
MOMENTS = "the moments of inertia appear to be permuted to ({})"


def checked(adapter, shape):
    return run_check(EngineEntry(adapter.label, adapter), shape if shape == "displaced corner" else f"striking {shape}")


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("shape", "built", "message"),
    [
        (
            "cylinder",
            lambda body: {"type": KINDS.mjGEOM_BOX, "size": [body.radius, body.radius, body.half_length]},
            "a cylinder appears to be built as a box",
        ),
        (
            "capsule",
            lambda body: {"type": KINDS.mjGEOM_CYLINDER},
            "a capsule appears to be built as a cylinder, without the half balls at its ends",
        ),
        (
            "capsule",
            lambda body: {"size": [body.radius, body.half_length - body.radius, 0.0]},
            "a capsule appears to be too short by its half balls; half_length is without them",
        ),
        (
            "cylinder",
            lambda body: {"size": [body.radius, 2.0 * body.half_length, 0.0]},
            "the body appears to be twice as long as it should be: is a length read as half_length?",
        ),
        (
            "capsule",
            lambda body: {"size": [0.5 * body.radius, body.half_length, 0.0]},
            "the radius is half as large as it should be: is a radius read as a diameter?",
        ),
        ("cylinder", lambda body: {"quat": [1.0, 0.0, 0.0, 0.0]}, "the axis of a capsule or a cylinder appears to be z; it is y"),
        ("capsule", lambda body: {"quat": [ROOT, 0.0, ROOT, 0.0]}, "the axis of a capsule or a cylinder appears to be x; it is y"),
        ("ellipsoid", lambda body: {"type": KINDS.mjGEOM_BOX}, "an ellipsoid appears to be built as a box"),
        ("ellipsoid", lambda body: {"size": np.roll(body.half_extents, 1)}, "the half extents appear to be permuted to (z, x, y)"),
        (
            "mesh",
            lambda body: {"pos": body.centre},
            "a mesh appears to be about the origin of its file; a state has the centre of mass",
        ),
        (
            "displaced corner",
            lambda body: {"pos": 0.0 * body.centre},
            "the shape appears to be built about the centre of mass; it is about -centre",
        ),
        ("displaced corner", lambda body: {"pos": body.centre}, "the shape appears to be built about +centre; it is about -centre"),
    ],
)
def test_wrong_shape_is_named(monkeypatch, shape, built, message):
    right = mujoco_model._shape
    monkeypatch.setattr(mujoco_model, "_shape", lambda scene, form: right(scene, form) | built(scene.body))
    found = checked(engine("mujoco"), shape)
    assert (found.outcome, found.message) == ("failed", message)


@pytest.mark.extended
@pytest.mark.parametrize("shape", ["capsule", "cylinder", "ellipsoid", "mesh"])
def test_swapped_moments_of_inertia_are_named(monkeypatch, shape):
    right = mujoco_model.principal_frame
    monkeypatch.setattr(mujoco_model, "principal_frame", lambda tensor: (right(tensor)[0][[1, 0, 2]], right(tensor)[1]))
    found = checked(engine("mujoco"), shape)
    assert (found.outcome, found.message) == ("failed", MOMENTS.format("y, x, z"))


def test_engine_without_a_shape_declines_its_check():
    found = checked(made.Exact(), "capsule")
    assert (found.outcome, found.message) == ("declined", "the adapter maps the shapes sphere, box, vertices onto a floor, not capsule")
