"""The replay as an HTML page."""

from markupsafe import Markup

from reports.pages import page
from reports.replay import Replay, as_data


def replay_page(replays: list[Replay], plots: dict[str, str]) -> str:
    """The page: a viewer for each scene, with its plots over time.

    Args:
        replays: One per scene.
        plots: SVG element of each scene, by its name.
    """
    return page("replay.html", replays=[(replay, as_data(replay), Markup(plots[replay.scene.name])) for replay in replays])
