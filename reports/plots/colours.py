"""Labels and styles that all plots and tables share: a name to read, a colour, a marker and a dash pattern per engine, by its label."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple
from zlib import crc32

from dropspin.comparisons.engines.options import parts_of
from dropspin.comparisons.engines.registry import BUILT_IN

Dashes = Literal["", "dashed", "dotted", "dashdot", "long"]
TABLES: dict[str, Any] = tomllib.loads(Path(__file__).with_name("plots.toml").read_text(encoding="utf-8"))

# Okabe & Ito (2008), Color Universal Design: distinguishable with any colour vision, on white and on near black.
KNOWN = {"wang": ("#0072B2", "o"), "mujoco": ("#D55E00", "s"), "pybullet": ("#009E73", "D")}
# The last six were chosen to differ from all others by 11 or more in CAM02-UCS, also with simulated deuteranopia and protanopia.
COLOURS = ("#CC79A7", "#E69F00", "#56B4E9", "#336666", "#994433", "#6688FF", "#88BB77", "#BBAAAA", "#CC0099")
MARKERS = ("^", "v", "P", "X", "*")
STYLES = [(colour, marker) for marker in MARKERS for colour in COLOURS]
REPEATED: tuple[Dashes, ...] = ("", "dashdot", "long")
"""The dash patterns of the first, second and third engine of a colour; those of exact solutions, fits and guides are others."""

NAMES: dict[str, str] = {name: home.adapter for name, home in BUILT_IN.items()} | TABLES["names"]
"""The names of engines as their authors write them; an engine that is not listed keeps the name by which commands take it."""
OPTIONS = {"integrator=rk4": "RK4", "rotation=rk4": "RK4", "integrator=euler": "Euler", "profile=default": "default settings"}
LABEL = re.compile(r"([^\[\]\s,]+(?:\[[^\[\]]*\])?)(, .*)?")


class EngineStyle(NamedTuple):
    """How the lines of an engine look: a colour, a marker of matplotlib and a dash pattern."""

    colour: str
    marker: str
    dashes: Dashes


def engine_styles(engines: Sequence[str]) -> dict[str, EngineStyle]:
    """A style for each engine, by its label including options.

    The label alone determines colour and marker, in every plot and page. If two engines of a plot have the same colour, one of them gets
    the next one of those that the fewest have; if no colour is left, its line has a dash pattern. Pairs of colour and marker repeat beyond
    48 engines.
    """
    styles = {engine: EngineStyle(*KNOWN[engine], "") for engine in engines if engine in KNOWN}
    for engine in sorted(set(engines) - set(KNOWN)):
        first = crc32(engine.encode("utf-8", "surrogatepass")) % len(STYLES)
        candidates = [*STYLES[first:], *STYLES[:first]]
        colours = [style.colour for style in styles.values()]
        pairs = {style[:2] for style in styles.values()}
        unused = [style for style in candidates if style not in pairs]
        colour, marker = min(unused or candidates, key=lambda style: colours.count(style[0]))
        styles[engine] = EngineStyle(colour, marker, REPEATED[colours.count(colour) % len(REPEATED)])
    return {engine: styles[engine] for engine in engines}


def human_label(label: str) -> str:
    """The name of an engine with its options as plots show it: `MuJoCo, RK4` for `mujoco[integrator=rk4]`; any other text unchanged.

    Text that follows the engine after a comma stays, as in `mujoco, in milliseconds`.
    """
    if not (parts := LABEL.fullmatch(label)):
        return label
    name, options = parts_of(parts[1])
    return ", ".join([NAMES.get(name, name.rpartition(":")[2]), *map(_in_words, options)]) + (parts[2] or "")


def in_sentence(label: str) -> str:
    """An engine as a sentence names it: `MuJoCo (RK4)` for `mujoco[integrator=rk4]`."""
    name, _, settings = human_label(label).partition(", ")
    return f"{name} ({settings})" if settings else name


def _in_words(option: str) -> str:
    name, _, value = option.partition("=")
    return OPTIONS.get(option) or f"{name.replace('_', ' ')} {re.sub('-(?=[0-9.])', '−', value)}"
