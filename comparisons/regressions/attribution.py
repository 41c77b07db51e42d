"""The differences between two runs, and the one to which a change of results is attributed."""

from collections.abc import Collection, Mapping
from typing import Any, Literal, NamedTuple

from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.engines.registry import BUILT_IN
from dropspin.comparisons.engines.settings import as_option
from dropspin.comparisons.regressions.changes import Motion
from dropspin.comparisons.results.provenance import MEASURING
from dropspin.scenarios.text import printable

Stamp = Mapping[str, Any]
Origin = Literal["engine", "adapter", "settings", "dropspin", "surroundings", "either", "absent", "nothing"]
ACCEPTED = "accepted"
"""The case of the settings that are stored with accepted results."""
VERSIONS = frozenset({"version", "numba"})
"""What is among the settings and is none."""
LONGEST = 100
"""Characters of a setting that is stored with accepted results."""
OWN_CODE = "dropspin's own code"
OF_DROPSPIN = frozenset({"dropspin", "code"})
"""The differences of the surroundings that are dropspin's."""
MACHINE = {"python": "Python", "cpu": "processor", "platform": "platform"}
UNRECORDED = "the engine is not deterministic, or has changed without a new version"
OTHER_MACHINE = ", or has run on another processor, which older baselines do not record"
OWN_ENGINE = "wang"
"""The engine that is a part of dropspin."""
CORRECTION = "a correction of dropspin, not a change of the engine"


class Attribution(NamedTuple):
    """The cause to which the changes of an engine's results are attributed.

    Attributes:
        origin: `absent` if one of the runs has no measurements of the engine. `engine`, `adapter` or `settings` for the first of these that
            differs: the engine's version, the adapter's code, the settings. `dropspin` if its version or code differs, and the motions are
            the same in both runs or nothing else differs but the code of a built-in adapter. `surroundings` for dropspin, its code, the
            libraries and the machine. `either` if the surroundings differ and also the engine, its adapter, its settings or its motions,
            so that the cause cannot be isolated. `nothing` if the whole provenance is the same in both runs, or all
            that differs is excluded by an engine with the same results.
        message: The cause in a sentence, without the engine's name.
        is_correction: Whether the cause is a correction of dropspin, not a change of the engine.
    """

    origin: Origin
    message: str
    is_correction: bool = False


def surroundings(old: Stamp, new: Stamp) -> dict[str, str]:
    """The differences that affect all engines, as text by name, in what both record."""
    versions = {name: (name, old["versions"].get(name), new["versions"].get(name)) for name in MEASURING}
    machine = {key: (word, old.get(key), new[key]) for key, word in MACHINE.items()}
    pairs = versions | {"code": (OWN_CODE, old.get("code"), new["code"])} | machine
    differing = {key: pair for key, pair in pairs.items() if None not in pair and pair[1] != pair[2]}
    return {key: word if key == "code" else f"{word} {one} → {other}" for key, (word, one, other) in differing.items()}


def common_settings(stamp: Stamp, engine: str) -> dict[str, str]:
    """The settings that are the same in all cases of an engine, as text, but for long ones."""
    cases = [{name: as_option(value) for name, value in case.items()} for case in stamp["settings"].get(engine, {}).values()]
    common = [setting for setting in (cases[0] if cases else {}).items() if all(setting in case.items() for case in cases)]
    return {name: text for name, text in common if name not in VERSIONS and len(text) <= LONGEST}


def changed_settings(old: Stamp, new: Stamp, engine: str) -> dict[str, str]:
    """The settings of an engine that differ between two runs in the same case, with their earlier values, empty for none.

    Of accepted results those are known that were the same in all cases.
    """
    before, after = (stamp["settings"].get(engine, {}) for stamp in (old, new))
    pairs = [(before[case], after[case]) for case in before if case in after]
    if ACCEPTED in before:
        accepted, now = before[ACCEPTED], common_settings(new, engine)
        pairs = [({name: accepted[name] for name in accepted if name in now}, {name: now[name] for name in now if name in accepted})]
    texts = [[{name: as_option(value) for name, value in case.items() if name not in VERSIONS} for case in pair] for pair in pairs]
    return {name: was.get(name, "") for was, now in texts for name in {**was, **now} if was.get(name) != now.get(name)}


def of_engine(old: Stamp, new: Stamp, engine: str) -> dict[Origin, str]:
    """The differences of the engine itself, the most likely cause first."""
    found: dict[Origin, str] = {}
    name, stamped = engine_name(engine), [stamp["settings"].get(engine, {}) for stamp in (old, new)]
    versions = [sorted({printable(str(one["version"])) for one in cases.values() if "version" in one}) for cases in stamped]
    if versions[0] != versions[1] and all(versions):
        found["engine"] = f"{name} {' → '.join(map(', '.join, versions))}"
    if engine in old["adapters"] and old["adapters"][engine] != new["adapters"].get(engine):
        found["adapter"] = f"the code of {name}'s adapter"
    asked_for = [engine_name(stamp.get("names", {}).get(engine, "")) for stamp in (old, new)]
    classes = [given.rpartition(":")[2] for given in asked_for if ":" in given]
    if len({*classes}) == 2:  # two classes of one file may have the same name as engines
        found["adapter"] = ", ".join([" → ".join(map(printable, asked_for)), *filter(None, [found.get("adapter")])])
    if changed := changed_settings(old, new, engine):
        found["settings"] = f"its settings ({', '.join(map(printable, changed))})"
    return found


def attribute(old: Stamp, new: Stamp, engine: str, unmoved: Collection[str], motions: Motion = "unknown") -> Attribution:
    """Attribute the changes of an engine's results.

    Args:
        old: Provenance of the earlier run.
        new: Provenance of the later run.
        engine: Label of the engine whose results changed.
        unmoved: Other engines of both runs whose results are all the same, which excludes libraries and machine as the cause.
        motions: Whether the engine's motions, from which these results were measured, are the same bit for bit.
    """
    absent = [word for word, stamp in (("earlier", old), ("later", new)) if not stamp["settings"].get(engine)]
    if absent:
        return Attribution("absent", f"it has no measurements in the {absent[0]} run: it broke down, declined, or is missing")
    own, around = of_engine(old, new, engine), surroundings(old, new)
    listed, name = ", ".join([*own.values(), *around.values()]), engine_name(engine)
    if motions == "same" and around.keys() & OF_DROPSPIN:
        corrected = ", ".join(text for part, text in around.items() if part in OF_DROPSPIN)
        return Attribution("dropspin", f"{CORRECTION}, whose motions are the same bit for bit: {corrected}", is_correction=True)
    if not own and not around:
        unknown = UNRECORDED + OTHER_MACHINE * (old.get("cpu") is None and not unmoved)
        return Attribution("nothing", f"no recorded property {'and no motion differs' if motions == 'same' else f'differs; {unknown}'}")
    if around and around.keys() <= OF_DROPSPIN and own.keys() <= ({"adapter"} if name in BUILT_IN else set()):
        if motions == "different" and name == OWN_ENGINE:
            return Attribution("dropspin", f"a change of dropspin, of which {name} is a part: {listed}")
        if not own:
            differ = f"the motions of {name} differ"
            why = f"{differ} too" if motions == "different" else f"it is not recorded whether {differ}"
            return Attribution("either", f"{listed}; the cause cannot be isolated, because {why}")
        return Attribution("dropspin", f"{CORRECTION}{', as far as it is recorded' * (motions == 'unknown')}: {listed}", is_correction=True)
    others = f"but the results of {', '.join(sorted(unmoved))} are the same"
    if not own:
        possible = [text for part, text in around.items() if not unmoved or motions == "same" or part in OF_DROPSPIN]
        if possible:
            return Attribution("surroundings", f"attributed to the surroundings: {', '.join(possible)}")
        return Attribution("nothing", f"no recorded property of {name} differs; {UNRECORDED}; {listed} differ, {others}")
    first = next(iter(own))
    message = f"attributed to {'the engine' if first == 'engine' else f'its {first}'}: {', '.join(own.values())}"
    if not around:
        return Attribution(first, message)
    if unmoved:
        return Attribution(first, f"{message}; {', '.join(around.values())} differ too, {others}")
    return Attribution("either", f"{listed}; the cause cannot be isolated, because the results of every engine changed")
