"""The study of the command `dropspin diagnose`: every question about every loose body of a user's model, with the remedies tried."""

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dropspin.comparisons.diagnosis.answers import COEFFICIENT, Answer, Finding
from dropspin.comparisons.diagnosis.flight import fall, spin, tumble, worst_tumble
from dropspin.comparisons.diagnosis.inertia import armature, inertia
from dropspin.comparisons.diagnosis.landing import impact, rest
from dropspin.comparisons.diagnosis.remedies import Question, Targets, answers_to
from dropspin.comparisons.diagnosis.sliding import creep, roll, slide
from dropspin.comparisons.diagnosis.xml_file import Setting
from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import present_entry
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError
from dropspin.scenarios.bodies.mesh import openness
from dropspin.scenarios.bodies.mesh_files import read_mesh

if TYPE_CHECKING:  # each engine is imported in its own process alone
    from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
    from dropspin.comparisons.diagnosis.pybullet_body import PyBulletModel

READERS = {".xml": ("mujoco",), ".mjcf": ("mujoco",), ".urdf": ("mujoco", "pybullet"), ".obj": ("mujoco",), ".stl": ("mujoco",)}
"""The engines that read a file, by its ending."""
MESH = """<mujoco><asset><mesh name="mesh" file="{path}" inertia="{inertia}" scale="{scale} {scale} {scale}"/></asset><worldbody>
<body name="{name}"><freejoint/><geom type="mesh" mesh="mesh" density="{density:g}"/></body></worldbody></mujoco>"""
"""A model with a body whose only geometry is a mesh."""
LONG = 10.0
"""Length of a body from which a model may be in mm, read as m [m]."""
IN_FORCE = ("name", "engine", "version", "dt", "mass", "surface", "friction", "friction_across")
"""What a diagnosis has as an engine has it in force."""
QUESTIONS: tuple[Question, ...] = (armature, fall, spin, tumble, worst_tumble, impact, rest, slide, creep, roll)


class BodyDiagnosis(NamedTuple):
    """The diagnosis of one body with one engine.

    Attributes:
        name: The body's name.
        engine: The engine.
        version: The version of the engine.
        dt: The time step of the file, or the engine's default [s].
        mass: Mass of the body [kg].
        shapes: The shapes of the body.
        surface: The name of the surface on which the body lands; empty if there is none.
        others: Other surfaces on which the body may land; empty if the surface was given.
        friction: The coefficient of friction between the body and the surface.
        friction_across: That in the perpendicular direction; NaN if it is the same.
        answers: The measured values with their exact values and findings.
        settings: By name of a setting, its text in the model file, with file and line.
        unmodelled: Parts of the file, besides the body, that the simulations leave out.
        breakdown: The reason why there are no answers, or none for which the body is simulated; empty if there is no such reason.
        declined: Whether that is because the engine cannot read or simulate the body, not because it broke down.
    """

    name: str
    engine: str
    version: str = ""
    dt: float = math.nan
    mass: float = math.nan
    shapes: tuple[str, ...] = ()
    surface: str = ""
    others: tuple[str, ...] = ()
    friction: float = math.nan
    friction_across: float = math.nan
    answers: tuple[Answer, ...] = ()
    settings: dict[str, Setting] | None = None
    unmodelled: tuple[str, ...] = ()
    breakdown: str = ""
    declined: bool = False

    @property
    def findings(self) -> list[tuple[Answer, Finding]]:
        """Each finding, with the answer that has it."""
        return [(answer, finding) for answer in self.answers for finding in answer.findings]


@dataclass(frozen=True)
class Diagnosis:
    """The values and findings for the bodies of a model file.

    Attributes:
        file: The file as the user gave it.
        bodies: The values and findings for each body and engine.
        others: The bodies that are not diagnosed, and why; empty if there are none, or if bodies were chosen.
    """

    file: str
    bodies: tuple[BodyDiagnosis, ...]
    others: str = ""

    @property
    def failed(self) -> bool:
        """Whether a body has an impossible inertia, or misses a target."""
        return any(finding.kind in ("impossible", "target") for body in self.bodies for _, finding in body.findings)

    @property
    def broke_down(self) -> bool:
        """Whether an engine broke down, or none has a result for a body."""
        with_result = {body.name for body in self.bodies if not body.breakdown}
        return any(not body.declined or body.name not in with_result for body in self.bodies if body.breakdown)


def diagnose(
    file: str | Path,
    engines: str | Sequence[str] = (),
    bodies: str | Sequence[str] = (),
    *,
    on: str | None = None,
    loose: bool = False,
    density: float = 1000.0,
    scale: float = 1.0,
    restitution: float | None = None,
    friction: float | None = None,
    resources: ResourceLimits = ONE_MINUTE,
    jobs: int | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """Measure how the settings of a model change the motion of its bodies, compared with exact solutions.

    Args:
        file: An MJCF or URDF file, or a mesh (OBJ, STL).
        engines: `mujoco` and `pybullet`, or one of them; by default, those that can read the file.
        bodies: The names of bodies; by default, all free bodies.
        on: The name of the geometry on which the bodies land; by default, the plane or box below them.
        loose: Whether to diagnose also links that move on joints, each without its joint.
        density: Density of a mesh [kg/m³].
        scale: Length of a unit of a mesh's coordinates [m].
        restitution: Target for the coefficient of restitution.
        friction: Target for the coefficient of friction.
        resources: The processor time [s] and memory [bytes] that one body may use.
        jobs: Number of bodies to diagnose at a time; by default, the number of processors.
        on_progress: Called with a description of the current work and the fraction of the bodies that are done.

    Returns:
        The values and findings for each body and engine.

    Raises:
        DropspinError: The file is not a model, no engine can read it, it has no body of a name in `bodies`, or a target is impossible.
    """
    if restitution is not None and not 0.0 <= restitution <= 1.0:
        raise DropspinError(f"restitution: got {restitution!r}; a target is from 0 to 1.")
    if friction is not None and not 0.0 < friction < math.inf:
        raise DropspinError(f"friction: got {friction!r}; a target is positive.")
    given, path, wanted = str(file), Path(file), [bodies] if isinstance(bodies, str) else list(bodies)
    ending = path.suffix.lower()
    if ending not in READERS:
        raise DropspinError(f"{given}: is not a model file; give one that ends in {', '.join(READERS)}.")
    chosen = [engines] if isinstance(engines, str) else list(engines) or list(READERS[ending])
    for engine in chosen:
        if engine not in READERS[ending]:
            if engine_name(engine) in READERS[ending]:
                raise DropspinError(f"{engine}: diagnose takes an engine without options; settings are those of the file, or its defaults.")
            raise DropspinError(f"{engine} does not read {ending} files; use {' or '.join(READERS[ending])}.")
    with tempfile.TemporaryDirectory() as folder:
        if ending in (".obj", ".stl"):
            path = _model_of_mesh(path, given, Path(folder), density, scale)
        entries = list(map(present_entry, chosen))
        with started_crews(1, 1, entries, resources) as crews:
            read = [(entry, crews[0].call(entry, _bodies, path, given, wanted, loose)) for entry in entries]
            others = [crews[0].call(entry, _others, path, given, names) for entry, names in read if isinstance(names, list) and not wanted]
        pieces = [(entry, name) for entry, names in read if isinstance(names, list) for name in names]
        refusals = _refusals(given, read)
        with started_crews(jobs, len(pieces), entries, resources) as crews:

            def of_body(piece: tuple[EngineEntry, str], processes: EngineProcesses, report: Callable[[str], None]) -> BodyDiagnosis:
                entry, name = piece
                report(f"{name} with {entry.label}")
                asked = (path, given, name, on, Targets(restitution, friction))
                found = processes.call(entry, _diagnosed, *asked, QUESTIONS)
                if isinstance(found, BodyDiagnosis):
                    return found
                declined = isinstance(found, DropspinError) or found.verdict == "declined"
                longer = "; --time-limit gives it more" if isinstance(found, Breakdown) and found.verdict == "timed_out" else ""
                without = found if declined else processes.call(entry, _diagnosed, *asked, ())
                known = without if isinstance(without, BodyDiagnosis) else BodyDiagnosis(name, entry.label)
                return known._replace(breakdown=f"{found}{longer}", declined=declined)

            found = [*refusals, *results_in_parallel(pieces, of_body, crews, on_progress or ignore)]
            if all(body.declined for body in found):
                whys = (why if (why := body.breakdown).endswith(".") else f"{given}: {body.name}: {why}." for body in found)
                raise DropspinError(" ".join(dict.fromkeys(whys)))
            return Diagnosis(given, tuple(found), next((one for one in others if isinstance(one, str)), ""))


def _model_of_mesh(path: Path, given: str, folder: Path, density: float, scale: float) -> Path:
    """An MJCF file in a folder with a body that is a mesh.

    Raises:
        DropspinError: The file is no mesh, or the mesh has no volume.
    """
    points, faces = read_mesh(path, given)
    if why := openness(points, faces):
        raise DropspinError(f"{given}: the mesh {why}, so that it has no volume; mend it, or give the body in an MJCF file.")
    mesh = path.resolve()
    if path.suffix.lower() == ".stl":  # MuJoCo reads no text
        import trimesh  # takes half a second

        mesh = folder / "mesh.stl"
        trimesh.Trimesh(points, faces, process=False).export(mesh)
    is_inside_out = np.linalg.det(points[faces]).sum() < 0.0  # of which MuJoCo refuses the exact volume
    inertia_of = "legacy" if is_inside_out else "exact"
    model = folder / "mesh.xml"
    model.write_text(MESH.format(path=mesh, inertia=inertia_of, name=path.stem, density=density, scale=scale), encoding="utf-8")
    return model


def _refusals(given: str, read: Sequence[tuple[EngineEntry, list[str] | DropspinError | Breakdown]]) -> list[BodyDiagnosis]:
    """The bodies that some engines read, each without a result of every engine that refused the file or broke down on reading it.

    Raises:
        DropspinError: No engine read the file; of several that refused it, the reason of the first.
    """
    refused = [(entry.label, str(why), True) for entry, why in read if isinstance(why, DropspinError)]
    unread = "{}: cannot be read with {}: {}.".format
    broken = [(entry.label, unread(given, entry.label, why.reason), False) for entry, why in read if isinstance(why, Breakdown)]
    names = dict.fromkeys(name for _, found in read if isinstance(found, list) for name in found)
    if not names:
        raise DropspinError(" ".join(why for _, why, _ in refused[:1] + broken))
    return [BodyDiagnosis(name, label, breakdown=why, declined=declined) for label, why, declined in refused + broken for name in names]


@lru_cache(maxsize=1)
def _file(engine: str, path: Path, given: str) -> "MuJoCoModel | PyBulletModel":
    """A model as the engine of this process reads it, once for all bodies."""
    if engine == "mujoco":
        from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel

        return MuJoCoModel(path, given)
    from dropspin.comparisons.diagnosis.pybullet_body import PyBulletModel

    return PyBulletModel(path, given)


@lru_cache(maxsize=1)
def _known(*_: object) -> dict[tuple[object, ...], BodyDiagnosis]:
    """The diagnoses of bodies of a model in this process, by what equal bodies have in common."""
    return {}


def _bodies(entry: EngineEntry, path: Path, given: str, wanted: Sequence[str], loose: bool) -> list[str] | DropspinError:
    """The names of the bodies to diagnose; runs in the engine's process."""
    try:
        return _file(entry.adapter.name, path, given).bodies(wanted, loose)
    except DropspinError as error:  # of a type that may need more than a text
        return DropspinError(str(error))


def _others(entry: EngineEntry, path: Path, given: str, chosen: Sequence[str]) -> str:
    """The bodies that are not diagnosed, and why; runs in the engine's process."""
    return _file(entry.adapter.name, path, given).others(chosen)


def _diagnosed(
    entry: EngineEntry, path: Path, given: str, name: str, on: str | None, targets: Targets, questions: Sequence[Question]
) -> BodyDiagnosis | DropspinError:
    """The diagnosis of a body, with answers to some questions; runs in the engine's process."""
    given_to = (entry.adapter.name, path, given)
    try:
        body = _file(*given_to).body(name, on)
    except DropspinError as error:
        return DropspinError(str(error))
    known = _known(*given_to, on, targets, questions)
    key = body.likeness
    if key in known:
        return known[key]._replace(name=name)
    answers = inertia(body) + [answer for question in questions for answer in answers_to(question, body, targets)]
    if body.surface:
        frictions = (body.friction, body.friction_across)
        answers += [Answer("friction", COEFFICIENT, "1", measured=one) for one in frictions if not math.isnan(one)]
    answers += [Answer("file", key, "", findings=(Finding("changed", (key,), detail=made),)) for key, _, made in body.ignored]
    if body.parts and (length := float(np.ptp(body.points, axis=0).max())) > LONG:
        made = f"{length:.3g} m; dropspin reads SI units, and this may be a model in mm"
        answers.append(Answer("file", "length of the body", "", findings=(Finding("changed", detail=made),)))
    found = BodyDiagnosis(
        **{field: getattr(body, field) for field in IN_FORCE},
        shapes=tuple(part.shape.shape for part in body.colliding),
        others=tuple(body.others),
        answers=tuple(targets.judged(body, answers)),
        settings={**body.settings, **{key: setting for key, setting, _ in body.ignored}},
        unmodelled=tuple(body.unmodelled),
    )
    if key:
        known[key] = found
    return found
