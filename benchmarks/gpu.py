"""MJX, MuJoCo Warp, Newton and Genesis on a GPU, in at most eight minutes: `python benchmarks/gpu.py`, on a machine with a GPU.

Each engine gets an environment of its own, with dropspin from this checkout, beside the packages of the Python that runs the script. pip
takes what its own settings name, such as PIP_FIND_LINKS where there is no network. In the environment run the quick checks of `dropspin
conform`, then `dropspin symmetries twins` on the GPU and on the processor (`on_processor.py`), and `dropspin tradeoff`, which times
batches. The table is Markdown; it and the outputs are in the folder that `-o` names.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
LIMIT = 480.0
"""Wall time of the script [s]: what has not begun by then is left out, what runs is ended."""
EXTRAS = {"mjx": ["jax[cuda13]"], "mujoco-warp": [], "newton": [], "genesis": []}
"""The engines, and what they need on a GPU beside their extra."""
CHECKS = ("declines", "builds what is meant", "record and advance", "time", "waiting", "batches")
WORLDS = (1, 16, 256, 4096, 65536)
TWINS, THROUGHPUT = ("spin-asymmetric", "drop-ball"), "spin-asymmetric"


def main() -> None:
    """Run the checks and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("engines", nargs="*", default=list(EXTRAS), help="engines; all by default")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/gpu"))
    parser.add_argument("--worlds", type=int, nargs="+", default=WORLDS, help="numbers of worlds in a batch")
    parser.add_argument("--installed", action="store_true", help="use the Python that runs the script; install nothing")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    deadline, rows = time.monotonic() + LIMIT, []
    for number, name in enumerate(given.engines):
        end = time.monotonic() + (deadline - time.monotonic()) / (len(given.engines) - number)  # what an engine leaves, the next ones have
        rows.append(measured(name, given, end))
        (given.output / "table.md").write_text(table(rows, given.worlds), encoding="utf-8")
    print(table(rows, given.worlds))


def measured(name: str, given: argparse.Namespace, end: float) -> dict[str, str]:
    """The row of an engine, by column."""
    python = sys.executable if given.installed else installed(name, given.output, end)
    if not python:
        return {"engine": name, "checks": f"not installed: {name}-install.txt"}

    def answer(title: str, *command: str) -> list[dict[str, Any]]:
        return json_of(run([python, "-P", "-m", "dropspin", *command, "--json"], given.output / f"{name}-{title}", end))

    checks = answer("conform", "conform", name, *(word for check in CHECKS for word in ("--check", check)))
    twins = answer("twins", "symmetries", "twins", *TWINS, "-e", name, "-e", f"on_processor:{name.replace('-', '_')}")
    worlds, folder = ",".join(map(str, given.worlds)), str(given.output / f"{name}-tradeoff")
    costs = answer("costs", "tradeoff", THROUGHPUT, "-e", name, "--budget", "1", "--worlds", worlds, "-o", folder)
    return {"engine": name, "checks": of_checks(checks), "GPU and processor": of_twins(twins)} | of_costs(costs)


def installed(name: str, output: Path, end: float) -> str:
    """The Python of a new environment that has an engine; empty if it could not be installed."""
    folder = output / f"{name}-environment"
    steps = [
        [sys.executable, "-m", "venv", "--system-site-packages", str(folder)],
        [str(folder / "bin/pip"), "install", "--quiet", f"{ROOT}[{name}]", *EXTRAS[name]],
    ]
    done = all(run(step, output / f"{name}-install", end) is not None for step in steps)
    return str(folder / "bin/python") if done else ""


def run(command: list[str], log: Path, end: float) -> str | None:
    """The standard output of a command; None if it is not there or the time is over. `log`.txt has both outputs."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    try:
        seconds = max(0.0, end - time.monotonic())
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return None
    log.with_suffix(".txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    return done.stdout if done.returncode in (0, 1) else None


def json_of(text: str | None) -> list[dict[str, Any]]:
    """What a command printed as JSON; empty without."""
    return json.loads(text) if text else []


def of_checks(checks: list[dict[str, Any]]) -> str:
    """How many checks passed, and the names of the others."""
    others = [f"{check['check']} {check['outcome']}" for check in checks if check["outcome"] != "passed"]
    return ", ".join([f"{len(checks) - len(others)} of {len(checks)}", *others]) if checks else "no result"


def of_twins(twins: list[dict[str, Any]]) -> str:
    """The largest difference in each scene."""
    return "; ".join(f"{twin['scene']} {largest(twin)}" for twin in twins) or "no result"


def largest(twin: dict[str, Any]) -> str:
    """The largest difference of two motions, or why there is none."""
    if twin["reason"]:
        return str(twin["reason"])
    sizes = [size for size in (twin["before_contact"], twin["after_contact"]) if isinstance(size, float) and not math.isnan(size)]
    return f"{max(sizes):.1e}" if sizes else "0"


def of_costs(costs: list[dict[str, Any]]) -> dict[str, str]:
    """Steps per second of all worlds together, by the number of worlds: the most of any time step."""
    most: dict[str, float] = {}
    for row in costs:
        for name, value in row.items():
            if name.startswith("cost_per_world_") and isinstance(value, float):
                column = f"{int(name.rpartition('_')[2]):,} worlds"
                most[column] = max(most.get(column, 0.0), 1.0 / (value * row["dt"]))
    return {column: f"{rate:.2g}" for column, rate in most.items()}


def table(rows: list[dict[str, str]], worlds: tuple[int, ...]) -> str:
    """The rows as Markdown, under the name of the card."""
    columns = ["engine", "checks", "GPU and processor", *(f"{count:,} worlds" for count in worlds)]
    lines = [" | ".join(row.get(column, "–") for column in columns) for row in rows]
    head = [" | ".join(columns), " | ".join("---" for _ in columns)]
    return f"{card()}; steps per second of all worlds together in {THROUGHPUT}.\n\n" + "\n".join(f"| {line} |" for line in [*head, *lines])


def card() -> str:
    """The name of the GPU."""
    try:
        done = subprocess.run(
            ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"], capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        return "No GPU"
    return done.stdout.strip()


if __name__ == "__main__":
    main()
