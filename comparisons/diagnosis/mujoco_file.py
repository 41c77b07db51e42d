"""A model file as MuJoCo compiles it: its bodies, and what they may land on."""

import math
from collections.abc import Sequence
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.loose_body import Changes
from dropspin.comparisons.diagnosis.mjcf_defaults import option_setting
from dropspin.comparisons.diagnosis.mujoco_compiled import placed
from dropspin.comparisons.diagnosis.mujoco_contacts import contact_of
from dropspin.comparisons.diagnosis.mujoco_options import set_options
from dropspin.comparisons.diagnosis.mujoco_recompiled import LEAST
from dropspin.comparisons.diagnosis.mujoco_shapes import ALONG, distance_to, listed
from dropspin.comparisons.diagnosis.urdf_file import package_remedy, verify_one_root
from dropspin.comparisons.diagnosis.xml_file import read_source
from dropspin.comparisons.engines.mujoco_simulation import quiet
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import printable

BODY, GEOM = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_GEOM
PLANE, BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
EQUALITIES = "equality constraints"
SURFACES = (int(PLANE), int(BOX))
"""The kinds of geometries that a body may land on."""
UNMODELLED = {"nflex": "flexible bodies", "flg_surfacevel": "surface velocities", "flg_adhesion": "adhesion of geometries"}
MOST_NAMES, MOST_LISTED = 20, 3
TURNED = 1e-6
"""Difference of |cos(angle / 2)| from 1 up to which two orientations are the same."""
LONGEST_STEP = 0.1
"""The longest time step [s] in which the motions, of a second or less, are resolved."""
OF_CONTACT = ("contype", "conaffinity", "condim", "priority", "friction", "solmix", "solref", "solimp", "margin", "gap")
"""The settings of a geometry's contacts."""
OF_MESH = "in an MJCF file with this mesh"
"""Where to write settings for a mesh."""
ADDED = "a plane with default settings"
"""The surface of a file that has none."""


class MuJoCoFile:
    """A model file as MuJoCo compiles it.

    Args:
        path: The MJCF or URDF file.
        given: Its name for messages.

    Raises:
        DropspinError: MuJoCo does not compile it, or it is a URDF file that does not have exactly one root link.
    """

    def __init__(self, path: Path, given: str) -> None:
        self.source, self.given = read_source(path), given
        if path.suffix != Path(given).suffix:  # a mesh, of which dropspin wrote a model
            for element in self.source.every("mesh", "body", "freejoint", "geom"):
                element.file, element.line = OF_MESH, 0
        self.is_urdf = self.source.tag == "robot"
        self.refusal, self._touched = "", dict[tuple[int, ...], tuple[list[int], list[int]]]()
        if self.is_urdf:
            verify_one_root(self.source, given)
        try:
            with quiet():
                self.model = self._compiled(path)
        except (ValueError, mujoco.FatalError) as error:
            remedy = package_remedy(self.source) if "opening file" in str(error) else ""
            raise DropspinError(f"{given}: MuJoCo does not compile it: {one_line(error)}{remedy}.") from None
        if not 0.0 < self.model.opt.timestep <= LONGEST_STEP:
            written = option_setting(self.source, "option", "timestep", "")
            raise DropspinError(f"{given}: {written}: a time step must be above 0 and at most {LONGEST_STEP:g} s.")
        if not np.isfinite(self.model.opt.gravity).all():
            raise DropspinError(f"{given}: {option_setting(self.source, 'option', 'gravity', '')}: gravity must be three finite numbers.")
        self.compiled = placed(self.model)
        self.data = self.compiled[1]
        flags, bit = self.model.opt.disableflags, mujoco.mjtDisableBit
        self.gravity = np.zeros(3) if flags & bit.mjDSBL_GRAVITY else np.array(self.model.opt.gravity)
        self.has_contacts = not flags & (bit.mjDSBL_CONTACT | bit.mjDSBL_CONSTRAINT)
        self.is_safe = not flags & bit.mjDSBL_REFSAFE

    def _compiled(self, path: Path) -> Any:
        """The model, with an additional plane; an impossible inertia is balanced, and `refusal` has MuJoCo's reason."""
        self.spec = mujoco.MjSpec.from_file(str(path))
        if self.is_urdf:  # the root link would become a part of the world
            self.spec.compiler.fusestatic = False
        added, plain = (spec.worldbody.add_geom(name=ADDED, type=PLANE, size=[0.0, 0.0, 1.0]) for spec in (self.spec, mujoco.MjSpec()))
        for name in OF_CONTACT:  # not those of the file's default class
            setattr(added, name, getattr(plain, name))
        try:
            return self.spec.compile()
        except ValueError as error:
            if "balanceinertia" not in str(error):
                raise
            self.refusal, self.spec.compiler.balanceinertia = one_line(error), True
            return self.spec.compile()

    def names(self, kind: Any) -> dict[str, int]:
        """The numbers of bodies or geometries by name; one without a name is called by its kind and number."""
        what, number = ("body", self.model.nbody) if kind == BODY else ("geom", self.model.ngeom)
        return {printable(mujoco.mj_id2name(self.model, kind, one) or f"{what} {one}"): one for one in range(number)}

    @cached_property
    def heads(self) -> dict[str, int]:
        """The bodies that move against their parents, by name; of a URDF file, whose root is welded to the world, that too."""
        welded, bodies = self.model.body_weldid, self.names(BODY)
        static = [body for body in bodies.values() if body and welded[body] == 0]
        found = {name: body for name, body in bodies.items() if body and welded[body] == body}
        return {name: body for name, body in bodies.items() if body in static[:1]} | found if self.is_urdf else found

    def bodies(self, wanted: Sequence[str], loose: bool) -> list[str]:
        """The names of the bodies that are free, or that are asked for, or of all that move.

        Raises:
            UnknownName: There is no such body.
            DropspinError: No body is free.
        """
        verify_known("the model's body", wanted, self.heads)
        is_whole = loose or (self.is_urdf and len(self._heavy) == 1)
        found = wanted or [name for name in self._heavy if is_whole or self.is_free(self.heads[name])]
        if not found:
            if not self._heavy:
                needed = "a link a mass above 0" if self.is_urdf else "a body a free joint and a mass"
                raise DropspinError(f"{self.given}: no body both moves and has mass; give {needed}.")
            raise DropspinError(f"{self.given}: no body is free: {self.others([])}.")
        return list(found)

    def others(self, chosen: Sequence[str]) -> str:
        """The bodies with mass beside some that are chosen, why they are not free, and what to do; empty if there are none."""
        names = [name for name in self._heavy if name not in chosen]
        verbs = ("moves", "carries", "is") if len(names) == 1 else ("move", "carry", "are")
        are = "{} on joints, {} others on joints or {} tied".format(*verbs)
        there = f"{', '.join(names[:MOST_NAMES])}{' and others' * (len(names) > MOST_NAMES)} {are}"
        return f"{there}; name one with --body, or give --loose for all" if names else ""

    @cached_property
    def _heavy(self) -> list[str]:
        """The names of the bodies that move, not by `mocap`, and have mass."""
        moved, mass = self.model.body_mocapid, self.model.body_mass
        return [name for name, body in self.heads.items() if moved[body] < 0 and mass[self.group(body)].sum() > 0.0]

    def runs(self, dt: float, changes: Changes) -> bool:
        """Whether the whole model runs for a tenth of a second with other options."""
        spec = self.spec.copy()
        set_options(spec.option, self.model.opt, dt, changes)
        try:
            model = spec.compile()
        except ValueError:  # these options need others
            return False
        data = mujoco.MjData(model)
        with quiet():
            mujoco.mj_step(model, data, math.ceil(0.1 / dt))
        return not any(warning.number for warning in data.warning[-3:])

    def group(self, head: int) -> list[int]:
        """A body and what is welded to it."""
        welded = self.model.body_weldid
        return [body for body in range(1, self.model.nbody) if welded[body] == welded[head] and body >= head]

    def is_free(self, body: int) -> bool:
        """Whether a body has a free joint, and nothing is jointed or tied to it."""
        model = self.model
        has_joint = model.body_jntnum[body] == 1 and model.jnt_type[model.body_jntadr[body]] == mujoco.mjtJoint.mjJNT_FREE
        is_alone = np.sum(model.body_rootid == body) == len(self.group(body))
        return bool(has_joint and is_alone and EQUALITIES not in self.unmodelled(body))

    @cached_property
    def _coupled(self) -> dict[str, Array]:
        """The degrees of freedom that equality constraints, tendons and actuators act on: the columns of their Jacobians."""
        model = copy(self.model)
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
        data = mujoco.MjData(model)
        with quiet():
            mujoco.mj_forward(model, data)
        tying = data.efc_J_colind[: data.efc_J_rownnz[: data.ne].sum()]
        return {EQUALITIES: tying, "tendons": model.ten_J_colind, "actuators": data.moment_colind}

    def unmodelled(self, body: int) -> list[str]:
        """What acts on a body in the model, and not on the body alone; and the keyframes in which it is turned."""
        model, joint = self.model, self.model.body_jntadr[body]
        is_own = np.isin(np.arange(model.nbody), self.group(body))
        dofs = np.flatnonzero(is_own[model.dof_bodyid])
        found = [words for words, columns in self._coupled.items() if np.isin(columns, dofs).any()]
        is_free = joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        found += ["joints"] * bool((joint >= 0 and not is_free) or (is_own[model.body_parentid] & ~is_own).any())
        found += [words for field, words in UNMODELLED.items() if getattr(model, field, 0)]
        found += ["the stiffness of its joint"] * bool(joint >= 0 and np.any(model.jnt_stiffness[joint]))
        if is_free:
            turn = model.jnt_qposadr[joint] + np.arange(3, 7)
            turned = np.abs(model.key_qpos[:, turn] @ model.qpos0[turn]) < 1.0 - TURNED
            names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, int(key)) or str(key) for key in np.flatnonzero(turned)]
            found += [f"the pose of keyframe {', '.join(names[:MOST_LISTED])}{' and others' * (len(names) > MOST_LISTED)}"] * bool(names)
        return found

    def surfaces(self, wanted: str | None, own: Sequence[int]) -> list[int]:
        """The geometry of a name that some geometries land on; or what they may land on, the best first.

        That is the planes and boxes of the world that they collide with: those below them by height, then the other ones. Of these, planes
        that gravity does not lead away from come before boxes, and boxes before other planes. A plane that is added if there is none, or if
        none of them is below, and something of another kind may be.

        Raises:
            DropspinError: There is no geometry of this name, or it is neither a plane nor a box.
        """
        if wanted is not None:
            others = {name: geom for name, geom in self.names(GEOM).items() if geom not in own}
            verify_known("the model's geometry", [wanted], others)
            if self.model.geom_type[others[wanted]] not in SURFACES:
                raise DropspinError(f"--on {wanted}: is neither a plane nor a box; name one of these.")
            return [others[wanted]]
        added = self.names(GEOM)[ADDED]
        found = [geom for geom in self._still(own) if self.model.geom_type[geom] in SURFACES and self._collide(own, geom)]

        def rank(geom: int) -> tuple[float, bool, bool]:
            is_plane = self.model.geom_type[geom] == PLANE
            return self.height_above(geom, own), is_plane and self.data.geom_xmat[geom][[2, 5, 8]] @ self._down > -ALONG, not is_plane

        return sorted(found, key=rank) if found and not self.left_out(own) else [added] * self._collide(own, added)

    def height_above(self, surface: int, own: Sequence[int]) -> float:
        """The height of the top of some geometries above a plane or a box that is below the centre of mass of their bodies [m].

        It is infinite if they are beside or below the plane or box.
        """
        bodies, down = np.unique(self.model.geom_bodyid[own]), self._down
        centre = np.average(self.data.xipos[bodies], axis=0, weights=self.model.body_mass[bodies] + LEAST)
        turned, boxes = down @ self.data.geom_xmat[own].reshape(-1, 3, 3), self.model.geom_aabb[own]
        tops = self.data.geom_xpos[own] @ down + np.sum(turned * boxes[:, :3] - np.abs(turned) * boxes[:, 3:], axis=1)
        return distance_to(self.model, self.data, surface, centre + (tops.min() - centre @ down) * down, down)

    @property
    def _down(self) -> Array:
        """The direction of gravity, or of -z without it."""
        size = np.linalg.norm(self.gravity)
        return self.gravity / size if size else np.array([0.0, 0.0, -1.0])

    def missed(self, own: Sequence[int]) -> str:
        """A plane or a box of the world that some geometries fall through, and why; empty if there is none.

        If they land on something, it is what they would land on before. What collides with nothing at all is only seen, but for a plane
        that is all that there is.
        """
        kinds, names = self.model.geom_type, list(self.names(GEOM))
        held = {geom for geom in self._still(own) if self.has_contacts and self._collide(own, geom)}
        above = {geom: self.height_above(geom, own) if own else math.inf for geom in self._still(own) if kinds[geom] in SURFACES}
        lowest = min((above.get(geom, -math.inf) for geom in held), default=math.inf)
        seen = (self.model.geom_contype | self.model.geom_conaffinity) == 0
        through = [geom for geom, height in above.items() if geom not in held and not seen[geom] and height < lowest]
        through = sorted(through, key=above.__getitem__) or [geom for geom in above if kinds[geom] == PLANE and not held]
        if not through:
            return ""
        bodies, below = (
            {mujoco.mj_id2name(self.model, BODY, self.model.geom_bodyid[geom]) for geom in some} for some in (own, through[:1])
        )
        pairs = [(one, {one.attributes.get("body1"), one.attributes.get("body2")}) for one in self.source.every("exclude")]
        excluded = [f"{one.words} leaves out their contacts" for one, pair in pairs if pair & bodies and pair & below]
        flags = (option_setting(self.source, "flag", name, "enable") for name in ("contact", "constraint"))
        disabled = [f"contacts are disabled, by {flag}" for flag in flags if '"disable"' in flag.text]
        why = [*disabled, *excluded, "no geometry of the body collides with it"][0]
        discards = option_setting(self.source, "compiler", "discardvisual", "false")
        without = "the body has no geometry" + f", by {discards}" * ('"true"' in discards.text)
        return f"{names[through[0]]} does not hold it, because {why if own else without}"

    def left_out(self, own: Sequence[int]) -> str:
        """What some geometries collide with that they cannot land on, if no plane and no box of the world is below; else empty."""
        flat, others = self._touchable(own)
        return "" if any(math.isfinite(self.height_above(geom, own)) for geom in flat) else self._listed(others)

    def between(self, own: Sequence[int], surface: int) -> str:
        """The same above a plane or a box that they land on."""
        return self._listed([geom for geom in self._touchable(own)[1] if self.height_above(geom, own) < self.height_above(surface, own)])

    def _listed(self, geoms: Sequence[int]) -> str:
        return listed(self.model, list(self.names(GEOM)), geoms, MOST_LISTED)

    def _touchable(self, own: Sequence[int]) -> tuple[list[int], list[int]]:
        """What some collide with: planes and boxes of the world; its other geometries, and those below of bodies that are not free."""
        if (known := self._touched.get(tuple(own))) is not None:
            return known
        still, roots = self._still(own), self.model.body_rootid[self.model.geom_bodyid]
        jointed = [geom for geom in self._jointed if roots[geom] not in roots[own] and math.isfinite(self.height_above(geom, own))]
        found = [geom for geom in (*still, *jointed) if self.has_contacts and self._collide(own, geom)]
        flat = [geom for geom in found if geom not in jointed and self.model.geom_type[geom] in SURFACES]
        self._touched = {tuple(own): (flat, [geom for geom in found if geom not in flat])}  # of the last body alone
        return self._touched[tuple(own)]

    @cached_property
    def _jointed(self) -> list[int]:
        """The geometries of bodies that move and are not free."""
        heads = self.model.body_weldid[self.model.geom_bodyid].tolist()
        moving = {head for head in heads if head and not self.is_free(head)}
        return [geom for geom, head in enumerate(heads) if head in moving]

    def _still(self, own: Sequence[int]) -> list[int]:
        """The geometries of the world beside some and the plane that is added; the root of a URDF is no part of it."""
        left_out, bodies = {*own, self.names(GEOM)[ADDED]}, self.model.geom_bodyid
        still = np.flatnonzero((bodies if self.is_urdf else self.model.body_weldid[bodies]) == 0)
        return [geom for geom in still.tolist() if geom not in left_out]

    def _collide(self, own: Sequence[int], other: int) -> bool:
        return any(contact_of(self.model, one, other) for one in own)


def one_line(error: Exception) -> str:
    """The message of an error of MuJoCo, in one line."""
    text = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
    return f"{text} within the memory that dropspin allows an engine" if "allocate memory" in text else text
