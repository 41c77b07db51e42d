"""The replay as an HTML page."""

from collections.abc import Sequence

from dropspin.reports.pages import page
from dropspin.reports.plots.chart import Chart
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.replay import Replay, as_data


def replay_page(replays: Sequence[Replay], charts: Sequence[Sequence[Chart]]) -> str:
    """The page: a viewer for each scene, with its plots over time.

    Args:
        replays: One per scene.
        charts: The plots of each.
    """
    shown = [(one, as_data(one), [chart_data(chart) for chart in of_scene]) for one, of_scene in zip(replays, charts, strict=True)]
    return page("replay.html", replays=shown)
