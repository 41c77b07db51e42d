"""Which of an engine's changed settings explain an error: they are reverted one at a time, and in pairs where no single one is enough.

The error to explain is the difference between the engine's error and that with all of them reverted. A setting's share of it is the part
that reverting this one alone takes away. Reverting one of two settings may show nothing, as where a floor without restitution hides a
threshold below which there is none: then pairs of those settings are tried that matter in some way, alone or beside the others.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import combinations

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.settings import as_option
from dropspin.comparisons.running.adapter_output import verified_settings
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import verify_accepted
from dropspin.scenarios import DropspinError, Scenario

Reverted = frozenset[str]
ALL_SETTINGS = "profile=calibrated"
"""Stands for all settings in the results, for the share of an error that calibrated settings remove."""
ENOUGH = 0.9
"""Share of an error that explains it."""
NOTEWORTHY = 1e-3
"""Least share that is stated."""
MOST = 0.5
"""Share of a change that reverting settings takes away, at least: it is known roughly, from few starts; and of an error that is partly
explained.
"""
ADDITIVE = 0.02
"""Largest difference between the share of two settings and the sum of theirs where each has its own, relative to the sizes of these."""


def shares(
    error: Callable[[Reverted], float], changed: Sequence[str], change: float = 0.0, *, partly: bool = False
) -> dict[tuple[str, ...], float]:
    """The settings that explain an error.

    Args:
        error: The error with some settings reverted; NaN if it is undefined, infinite if no part of it can be stated.
        changed: The names of all settings that were changed.
        change: A change of the error, of which reverting all of them takes most away if they explain it.
        partly: Whether the setting that explains most of the error, and at least half, is named if no one or two explain nine tenths.

    Returns:
        The share of one setting, and that which a second one adds to it; or of two together, by both names, where their own shares do not
        add up. Where the sum is above 1, these are alternatives, unless a share is negative: that setting reduces the error. If no one or
        two of them explain nine tenths of the error: with `partly` one setting and the part that it explains, also where an error of the
        other sign is left, else empty.
    """
    error = cache(error)
    whole, calibrated = error(frozenset()), error(frozenset(changed))
    undone = whole - calibrated
    if not 0.0 < abs(undone) < math.inf or undone * change < MOST * change**2:
        return {}

    def share(*names: str) -> float:
        left = (error(frozenset(names)) - calibrated) / undone
        return 1.0 - left if math.isfinite(left) else -math.inf

    def explained(*names: str) -> float:
        """The part of the error that reverting them takes away, also where an error of the other sign is left."""
        return 1.0 - abs(1.0 - share(*names))

    single = {name: share(name) for name in changed}
    enough: dict[tuple[str, ...], float] = {(name,): of_it for name, of_it in single.items() if explained(name) >= ENOUGH}
    if len(enough) == 1:
        [(first,)] = enough
        is_all = 1.0 - explained(first) < NOTEWORTHY
        more = {name: explained(first, name) - explained(first) for name in changed if name != first and not is_all}
        second = max(more, key=lambda name: more[name], default=first)
        return enough | ({(second,): share(first, second) - single[first]} if more.get(second, 0.0) >= NOTEWORTHY else {})
    if enough:
        return enough
    beside = {name: 1.0 - share(*(other for other in changed if other != name)) for name in changed}
    mattering = [name for name in changed if max(abs(single[name]), abs(beside[name])) >= NOTEWORTHY]
    pairs: list[tuple[str, ...]] = list(combinations(mattering, 2))
    most = max((explained(*pair) for pair in pairs), default=0.0)
    best = {pair: share(*pair) for pair in pairs if explained(*pair) >= max(ENOUGH, most - ADDITIVE)}
    if partly and not best:
        name = max(single, key=explained)
        return {(name,): explained(name)} if explained(name) >= MOST else {}
    if len(best) == 1:
        [pair] = best
        of_each: dict[tuple[str, ...], float] = {(name,): single[name] for name in pair}
        sizes = [abs(part) for part in of_each.values()]
        if min(sizes) >= NOTEWORTHY and abs(sum(of_each.values()) - best[pair]) <= ADDITIVE * max(1.0, sum(sizes)) < math.inf:
            return of_each
    return best


def explaining(
    engine: Engine, back: Mapping[str, str | None], error_of: Callable[[Engine], float], change: float = 0.0, *, partly: bool = False
) -> dict[str, float]:
    """The changed options of an engine that explain its error: `shares` by option and value, such as `linearDamping=0.04`.

    Args:
        engine: The engine with its changed options.
        back: By the name of each, the value to which it is reverted; None if it is left out.
        error_of: The error of an engine; NaN if it is undefined.
        change: As of `shares`.
        partly: As of `shares`.
    """

    def error(names: Reverted) -> float:
        left = engine.without(names)
        reverted = {name: value for name in names if (value := back[name]) is not None}
        with suppress(DropspinError):  # for one of two settings that can be given together only
            return error_of(replace(left, options={**left.options, **reverted}))
        return math.nan

    found = shares(error, list(back), change, partly=partly)
    return {", ".join(f"{name}={engine.options[name]}" for name in names): share for names, share in found.items()}


def explaining_failure(engine: Engine, options: Mapping[str, str], error_of: Callable[[Engine], float]) -> dict[str, float]:
    """The settings that explain an error that fails: `explaining`, also partly. Empty if settings are not most of it.

    Args:
        engine: The engine.
        options: Its options, from `written_out`.
        error_of: The error of an engine; NaN if it is undefined.

    Returns:
        The shares; before them, by `ALL_SETTINGS`, the share of the error that calibrated settings take away, unless it is about all and
        there are shares.
    """
    calibrated = engine.calibrated.without(engine.given_numbers)
    if options.keys() <= calibrated.options.keys():
        return {}
    error, remaining = error_of(engine), error_of(calibrated)
    if not abs(remaining) < MOST * abs(error):
        return {}
    written = replace(engine, options=options)
    # Those that the engine itself has no option for count only if they matter: others may act once a setting is reverted.
    without = written.without([name for name in options if name in engine.settings and engine.unmet_need(name) is not None])
    alike = next((one for one in (without, written) if abs(error_of(one) - error) <= (1.0 - ENOUGH) * abs(error)), None)
    if alike is None:  # settings that have no option, or that are not reported, err too
        return {}
    changed = [name for name in alike.options if name not in calibrated.options]
    found, removed = explaining(alike, dict.fromkeys(changed), error_of, partly=True), 1.0 - remaining / error
    return found if found and abs(1.0 - removed) <= 1.0 - ENOUGH else {ALL_SETTINGS: removed, **found}


def written_out(entry: EngineEntry, scene: Scenario, dt: float) -> dict[str, str]:
    """The options that make an engine of the calibrated one, also if its profile is default; runs in the engine's process."""
    engine = entry.adapter
    if not engine.is_default:
        return dict(engine.options)
    calibrated, wanted = engine.calibrated, _in_force(engine, scene, dt)
    found = _in_force(calibrated, scene, dt)
    return calibrated.acting({**calibrated.options, **{name: text for name, text in wanted.items() if text != found[name]}})


def _in_force(engine: Engine, scene: Scenario, dt: float) -> dict[str, str]:
    """The settings and options of an engine that are in force in a scene, as text: as reported, or else as they are given."""
    verify_accepted(engine, scene)
    with engine.prepare(scene, dt) as simulation:
        reported = verified_settings(simulation.settings)
    names = [name for name in (*engine.choices, *engine.settings) if name != "profile"]
    texts = {name: as_option(value) for name, value in reported.items()}
    return {name: texts[name] if name in texts and engine.allows(name, texts[name]) else engine.option(name) for name in names}
