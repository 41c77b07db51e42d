"""Representations of the same scene: planted faults of bodies and floors are found, and sound engines keep the motion."""

from typing import ClassVar

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.driving import simulate
from dropspin.comparisons.symmetries.study import symmetries
from dropspin.scenarios import DropspinError, load
from dropspin.scenarios.variations import heavy_neighbour

DT = 4e-3


def statuses(engine, scene):
    return {one.symmetry: one for one in symmetries(scene, engine, dt=DT)}


def raised(height):
    """A body that is higher than it should be [m]."""
    return lambda state, time: state + height * np.eye(13)[1]


def pushed_upward(size):
    """An upward acceleration that the scene does not have."""

    def distort(state, time):
        return state + size * time**2 * np.eye(13)[1]

    return distort


def test_other_representation_with_another_motion_is_found():
    """A mesh whose mass is 1 % wrong falls alike and bounces alike, but a push moves it otherwise; a box that is a box does not."""

    class Meshes(made.Exact):
        name = "meshes"
        choices: ClassVar = {"body": ("box", "hull", "mesh")}
        representations: ClassVar = ("body",)

        def declines(self, scene):
            return "a hull would only approximate a ball" if self.option("body") == "hull" else None

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, pushed_upward(1e-3) if self.option("body") == "mesh" else None)

    found = statuses(Meshes(), "fall-spin")
    assert found["with body=mesh"].status == "lost"
    assert (found["with body=hull"].status, found["with body=hull"].reason) == ("not run", "a hull would only approximate a ball")
    assert {one.status for name, one in found.items() if not name.startswith("with ")} == {"kept"}
    [mesh] = [one for one in found.values() if one.motions is not None]
    assert mesh.symmetry == "with body=mesh"
    own, other = mesh.motions
    assert np.abs(other - own).max() == pytest.approx(1e-3 * load("fall-spin").duration ** 2)


def test_floor_that_is_higher_as_a_mesh_is_found():
    """By the collision margin of a mesh, 1 mm: a ball rolls 1 mm higher."""

    class Margin(made.Exact):
        name = "margin"
        choices: ClassVar = {"floor": ("plane", "box", "mesh")}
        representations: ClassVar = ("floor",)

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, raised(1e-3) if self.option("floor") == "mesh" else None)

    found = statuses(Margin(), "roll-ball")
    assert {name for name, one in found.items() if one.status != "kept"} == {"with floor=mesh"}
    assert (found["with floor=mesh"].status, found["with floor=mesh"].step) == ("lost", 1)


def test_motion_that_depends_on_a_heavy_body_far_away_is_found():
    """As of a solver that stops at an error that is relative to the mean mass of all bodies."""

    class Shared(made.Exact):
        name = "shared"
        choices: ClassVar = {"beside": ("none", "heavy")}
        representations: ClassVar = ("beside",)

        def prepare(self, scene, dt):
            bodies = [scene] if self.option("beside") == "none" else [scene, heavy_neighbour(scene)]
            mean = np.mean([one.body.mass for one in bodies]) / scene.body.mass
            return made.ExactSimulation(scene, dt, raised(1e-7 * mean))

    found = statuses(Shared(), "fall-spin")
    assert {name for name, one in found.items() if one.status == "lost"} == {"with beside=heavy"}


def test_representations_are_options_with_choices():
    class Unknown(made.Exact):
        name = "unknown"
        representations: ClassVar = ("shape",)

    with pytest.raises(DropspinError, match="unknown's representation 'shape' is unknown"):
        Unknown()


@pytest.mark.parametrize("label", ["mujoco[body=mesh,floor=box]", "mujoco[body=child]", "mujoco[body=child,profile=default]"])
def test_mujoco_represents_a_box_in_several_ways(label):
    """Its mass and inertia are read back, and the box strikes the floor with its edge at the same time."""
    scene = load("drop-box-edge")
    with engine(label).prepare(scene, DT) as simulation:
        built = simulation.as_built()
    assert built.mass == scene.body.mass
    np.testing.assert_allclose(built.inertia, scene.body.inertia_tensor, rtol=1e-12)
    profile = ["profile=default"] * ("default" in label)
    own = simulate(scene, f"mujoco[{','.join(profile)}]" if profile else "mujoco", dt=DT)
    np.testing.assert_allclose(simulate(scene, label, dt=DT).states, own.states, atol=1e-5)


def test_pybullet_gives_a_box_one_contact_on_a_plane():
    """On a plane a box that falls flat begins to turn; on a box it does not."""
    scene = load("drop-box-flat")
    turned = {floor: simulate(scene, f"pybullet[floor={floor}]", dt=1e-3).states[:, 3:6] for floor in ("plane", "box")}
    assert np.abs(turned["plane"]).max() > 0.05
    assert np.abs(turned["box"]).max() < 1e-9


def test_neighbour_is_the_same_body_a_thousand_times_as_heavy_on_the_floor():
    scene = load("drop-box-anyhow")
    other = heavy_neighbour(scene)
    np.testing.assert_allclose(other.body.inertia_tensor, 1e3 * scene.body.inertia_tensor, rtol=1e-12)
    assert other.clearance == pytest.approx(0.0, abs=1e-12)
    apart = other.initial_state - scene.initial_state
    assert np.hypot(apart[0], apart[2]) == pytest.approx(100.0 * scene.body.size)
    assert not apart[3:].any()


@pytest.mark.extended
@pytest.mark.parametrize(
    ("label", "scene", "most"),
    [
        ("mujoco[floor=mesh]", "drop-box-edge", 1e-9),
        ("mujoco[beside=heavy,floor=mesh,profile=default]", "fall-spin", 0.0),
        ("mujoco[beside=heavy,body=child]", "drop-ball-backspin", 1e-9),
        ("pybullet[floor=mesh]", "roll-ball", 1e-12),
        ("pybullet[beside=heavy]", "turn-box-rough", 0.0),
        ("rapier[floor=box]", "drop-ball-backspin", 1e-4),
        ("rapier[beside=heavy]", "turn-box-rough", 0.0),
        ("drake[floor=box]", "roll-ball", 1e-6),
        ("drake[beside=heavy]", "turn-box-rough", 1e-9),
        ("dart[floor=box]", "drop-box-corner", 1e-9),
        ("dart[beside=heavy]", "turn-box-rough", 0.0),
    ],
)
def test_sound_representations_keep_the_motion(label, scene, most):
    """Of a body whose mass and inertia are the scene's, at 5 to 1000 times the measured difference."""
    scene = load(scene)
    with engine(label).prepare(scene, DT) as simulation:
        built = simulation.as_built()
    assert built.mass == pytest.approx(scene.body.mass, rel=1e-6)
    np.testing.assert_allclose(built.inertia, scene.body.inertia_tensor, rtol=1e-6)
    own = simulate(scene, label.partition("[")[0], dt=DT)
    assert np.abs(simulate(scene, label, dt=DT).states - own.states).max() <= most


@pytest.mark.parametrize(
    "label", ["mujoco[floor=mesh]", "pybullet[floor=box]", "rapier[floor=mesh]", "drake[floor=box]", "dart[floor=box]"]
)
def test_floor_of_finite_size_is_declined_where_the_body_may_leave_it(label):
    scene = load("roll-ball")
    far = scene.starting_at(scene.initial_state + 1e3 * np.eye(13)[0])
    assert "of 2000 m, and the body may leave it" in engine(label).declines(far)
    assert engine(label.partition("[")[0]).declines(far) is None


@pytest.mark.extended
def test_calibrated_mujoco_depends_on_a_heavy_body_far_away():
    """Its solver stops at an error relative to the mean inertia of the model, which the heavy body raises."""
    [found] = [one for one in symmetries("drop-box-anyhow", "mujoco", dt=DT) if one.symmetry == "with beside=heavy"]
    assert found.status == "lost"


def test_mujoco_builds_the_floor_and_the_heavy_body_that_its_options_name():
    from mujoco import mjtGeom

    with engine("mujoco[beside=heavy,floor=mesh]").prepare(load("drop-box-edge"), DT) as simulation:
        model = simulation.model
    floor = model.geom("plane 0")
    assert floor.type[0] == mjtGeom.mjGEOM_MESH
    np.testing.assert_allclose(floor.pos, [0.0, -1e3, 0.0], atol=1e-9)
    assert model.body_mass.tolist() == [0.0, 1.0, 1000.0]
    assert model.npair == 2
