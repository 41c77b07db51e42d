"""What differs between how two runs came about, and to which of it a change of figures is put down."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, Literal

from comparisons.provenance import MEASURING

Stamp = Mapping[str, Any]
Culprit = Literal["engine", "adapter", "settings", "surroundings", "either", "absent", "nothing"]
MACHINE = {"python": "Python", "cpu": "processor", "platform": "platform"}


@dataclass(frozen=True)
class Blame:
    """What the changes of an engine's figures are put down to.

    Attributes:
        culprit: `absent` if it measured nothing in one of the runs; the engine's version, else its adapter's code, else its settings; the
            surroundings (dropspin, its code, the libraries, the machine); `either` where both differ and nothing tells them apart;
            `nothing` where all that is stamped is the same.
        said: The same in a sentence, without the engine's name.
    """

    culprit: Culprit
    said: str


def surroundings(old: Stamp, new: Stamp) -> list[str]:
    """What differs that all engines share."""
    found = [
        f"{package} {old['versions'][package]} → {new['versions'][package]}"
        for package in MEASURING
        if old["versions"][package] != new["versions"][package]
    ]
    if old["code"] != new["code"]:
        found.append("dropspin's own code")
    return found + [f"{word} {old[key]} → {new[key]}" for key, word in MACHINE.items() if old[key] != new[key]]


def of_engine(old: Stamp, new: Stamp, engine: str) -> dict[Culprit, str]:
    """What differs of an engine itself; what weighs most comes first."""
    found: dict[Culprit, str] = {}
    before, after = (stamp["settings"].get(engine, {}) for stamp in (old, new))
    versions = [{str(settings["version"]) for settings in stamped.values() if "version" in settings} for stamped in (before, after)]
    name = engine.split("[", maxsplit=1)[0]
    if versions[0] != versions[1] and all(versions):
        found["engine"] = f"{name} {_listed(versions[0])} → {_listed(versions[1])}"
    if old["adapters"].get(engine) != new["adapters"].get(engine):
        found["adapter"] = f"the code of {name}'s adapter"
    changed = _changed_settings(before, after)
    if changed:
        found["settings"] = f"its settings ({', '.join(changed)})"
    return found


def blame(old: Stamp, new: Stamp, engine: str, unmoved: Collection[str]) -> Blame:
    """What changes of an engine's figures are put down to.

    Args:
        old: Provenance of the earlier run.
        new: Of the later one.
        engine: Label of the engine, some figures of which have changed.
        unmoved: Other engines that ran in both, and whose figures are all the same: witnesses that it is not the surroundings.
    """
    silent = [word for word, stamp in (("earlier", old), ("later", new)) if not stamp["settings"].get(engine)]
    if silent:
        return Blame("absent", f"it measured nothing in the {silent[0]} run: it broke down, declined, or is missing")
    own, around = of_engine(old, new, engine), surroundings(old, new)
    if not own and not around:
        return Blame("nothing", "nothing that is stamped differs; the engine is not deterministic, or has changed under the same version")
    if not own:
        return Blame("surroundings", f"not the engine's: {', '.join(around)}")
    first = next(iter(own))
    word = "the engine's" if first == "engine" else f"its {first}" + ("'s" if first == "adapter" else "")
    said = f"{word}: {', '.join(own.values())}"
    if not around:
        return Blame(first, said)
    if unmoved:
        return Blame(first, f"{said}; {', '.join(around)} differ too, but the figures of {', '.join(sorted(unmoved))} are the same")
    return Blame("either", f"{', '.join(chain(own.values(), around))}; which of it cannot be told, as no engine's figures stayed the same")


def _changed_settings(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Names of the settings that differ in a scene and step that both ran; versions are told apart from them."""
    pairs = [(before[case], after[case]) for case in before if case in after]
    names = dict.fromkeys(name for pair in pairs for settings in pair for name in settings)
    differ = [name for name in names if any(one.get(name) != other.get(name) for one, other in pairs)]
    return [name for name in differ if name not in ("version", "numba")]


def _listed(versions: Collection[Any]) -> str:
    return ", ".join(sorted(map(str, versions)))
