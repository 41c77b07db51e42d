"""Replays as HTML pages."""

from collections.abc import Mapping, Sequence

import numpy as np

from dropspin.comparisons.symmetries.findings import Finding
from dropspin.reports.pages import page
from dropspin.reports.plots.chart import Chart
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.replay import Replay, as_data
from dropspin.reports.replay.motions import replay_together
from dropspin.scenarios import Scenario, Trajectory


def replay_page(replays: Sequence[Replay], charts: Sequence[Sequence[Chart]]) -> str:
    """The page: a viewer for each scene, with its plots over time.

    Args:
        replays: One per scene.
        charts: The plots of each.
    """
    shown = [(replay, as_data(replay), list(map(chart_data, of_scene))) for replay, of_scene in zip(replays, charts, strict=True)]
    return page("replay.html", replays=shown)


def symmetries_page(lost: Sequence[Finding], scenes: Mapping[str, Scenario], dt: float) -> str:
    """The page: for each symmetry that is lost, a viewer of the engine's motion and the one that should equal it.

    Args:
        lost: The findings, with their motions.
        scenes: The scenes by name.
        dt: The time step [s].
    """
    replays = []
    for finding in lost:
        assert finding.motions is not None
        labels = finding.engine, f"{finding.engine}, {finding.symmetry}"
        times = dt * np.arange(len(finding.motions[0]), dtype=np.float64)
        motions = {label: Trajectory.from_states(times, states) for label, states in zip(labels, finding.motions, strict=True)}
        replays.append(replay_together(scenes[finding.scene], dt, motions))
    return replay_page(replays, [[]] * len(replays))
