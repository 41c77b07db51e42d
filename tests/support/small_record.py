"""A small record: two engines, two scenes, and a release that could not be installed; its texts have markup."""

from itertools import product

from dropspin.comparisons.record.store import Record, machine
from dropspin.scenarios import load

HOSTILE = "<img src=x onerror=alert(1)>"
SCENES = {"spin-asymmetric": ("orientation_error", "rad"), "drop-ball": ("bounce_height_error", "1")}


def rows(label, value, declined=()):
    """The rows of a label, whose errors are `value` times the time step."""
    motion = f"{int(value * 1e3):064x}"
    for (scene, (metric, unit)), dt in product(SCENES.items(), (0.004, 0.001)):
        case = {"label": label, "scene": scene, "scene_digest": load(scene).digest, "dt": dt, "adapter": "a"}
        if scene in declined:
            yield case | {"verdict": "declined", "reason": HOSTILE}
        else:
            found = {
                "metric": metric,
                "unit": unit,
                "value": value * dt,
                "cost": 2e-6 / dt,
                "median_cost": 3e-6 / dt,
                "relative_cost": 20.0,
            }
            found |= {"low": 0.5 * value * dt, "high": 2.0 * value * dt} if scene == "drop-ball" else {}
            yield case | found | {"verdict": "measured", "reason": "", "trajectory": motion}


def write_record(folder):
    """MuJoCo with and without its default settings, in three releases and one that cannot be installed, and PyBullet in one."""
    record, common = Record(folder), machine()
    for release, value, declined in (("3.9.0", 12.7, ["drop-ball"]), ("3.10.0", 12.7, []), ("3.11.0", 1e-3, [])):
        found = [row for label in ("mujoco", "mujoco[profile=default]") for row in rows(label, value, declined)]
        record.write("mujoco", release, found, common | {"versions": f"mujoco {release}, numpy 2.0.0"})
    record.write("mujoco", "3.10.1", [{"verdict": "missing", "reason": f"not installable: {HOSTILE}"}], common)
    sent = Record(f"{folder}-sent")
    found = [*rows("mujoco", 12.7), *rows("mujoco[profile=default]", 1.0)]
    sent.write("mujoco", "3.9.0", found, common | {"processor": f"another {HOSTILE}", "versions": "mujoco 3.9.0"})
    record.merge([f"{folder}-sent"])
    record.write("pybullet", "3.2.7", list(rows("pybullet", 0.0)), common | {"versions": "pybullet 3.2.7"})
