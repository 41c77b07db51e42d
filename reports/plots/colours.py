"""Labels and styles that all plots and tables share: a colour and a marker per engine, by its label."""

from collections.abc import Sequence
from zlib import crc32

# Okabe & Ito (2008), Color Universal Design: distinguishable with any colour vision, on white and on near black.
KNOWN = {"wang": ("#0072B2", "o"), "mujoco": ("#D55E00", "s"), "pybullet": ("#009E73", "D")}
COLOURS = ("#CC79A7", "#E69F00", "#56B4E9", "#8C8C8C", "#A6761D", "#7B5EA7", "#B33B24", "#3D8B8B")
MARKERS = ("^", "v", "P", "X", "*")
STYLES = [(colour, marker) for marker in MARKERS for colour in COLOURS]


def engine_styles(engines: Sequence[str]) -> dict[str, tuple[str, str]]:
    """A colour and a marker for each engine, by its label including options.

    The label alone determines them, in every plot and page. If two engines of a plot have the same colour, one of them gets the next
    colour. Pairs repeat beyond 40 engines.
    """
    styles = {engine: KNOWN[engine] for engine in engines if engine in KNOWN}
    for engine in sorted(set(engines) - set(KNOWN)):
        first = crc32(engine.encode("utf-8", "surrogatepass")) % len(STYLES)
        candidates = [*STYLES[first:], *STYLES[:first]]
        taken_colours = {colour for colour, _ in styles.values()}
        unused = [style for style in candidates if style not in styles.values()]
        styles[engine] = next((style for style in unused if style[0] not in taken_colours), (unused or candidates)[0])
    return {engine: styles[engine] for engine in engines}


def engine_colours(engines: Sequence[str]) -> dict[str, str]:
    """The colour of each engine, from `engine_styles`."""
    return {engine: colour for engine, (colour, _) in engine_styles(engines).items()}
