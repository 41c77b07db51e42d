"""How often intervals of friction and restitution hold for synthetic tosses: part of `make coverage`, prints the table of docs/measured.md.

An engine makes the tosses, with .2 mm and 2 mrad of white noise at 148 Hz; it and another engine are fitted to them. Arguments
are the number of recordings of each size and the sizes: of the table, 30 10 20.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from dropspin.comparisons.logs.fit import log_fit
from support.in_process import engines_in_process
from support.log_fits import FINE, WANG, tosses

RECORDINGS, COUNTS, OTHER, SEED = 200, (10, 20, 50), "mujoco", 2026
FRICTION, RESTITUTION = (0.1, 0.4), (0.2, 0.6)
HEAD = ["tosses", "friction, same engine", "restitution, same engine", f"friction, by {OTHER}", "friction, any engine"]
HEAD += ["restitution differs", "is undecided"]


def outcome(count, number):
    """Whether the intervals hold, and whether restitution is said to differ, or to be undecided."""
    random = np.random.default_rng([SEED, count, number])
    truth = {"friction": random.uniform(*FRICTION), "restitution": random.uniform(*RESTITUTION)}
    with engines_in_process():
        fit = log_fit(tosses(random, count, WANG, **truth, dt=FINE / 8), [WANG, OTHER], jobs=1)
    of_each = {(one.parameter, one.engine): one for one in fit.estimates}
    asked = [of_each["friction", WANG], of_each["restitution", WANG], of_each["friction", OTHER], fit.friction]
    verdicts = [one.verdict for one in fit.transfers if one.parameter == "restitution"]
    held = [math.nan if one is None else float(one.lower <= truth[one.parameter] <= one.upper) for one in asked]
    return [*held, float("different" in verdicts), float("undecided" in verdicts)]


def main():
    rows = [HEAD, ["---"] * len(HEAD)]
    recordings, *counts = map(int, sys.argv[1:] or (RECORDINGS, *COUNTS))
    with ProcessPoolExecutor() as pool:
        for count in counts:
            shares = np.nanmean(list(pool.map(outcome, [count] * recordings, range(recordings))), axis=0)
            rows.append([str(count), *(f"{100.0 * share:.1f} %" for share in shares)])
    sys.stdout.writelines(f"| {' | '.join(cells)} |\n" for cells in rows)


if __name__ == "__main__":
    main()
