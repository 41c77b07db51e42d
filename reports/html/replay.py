"""The replay as a page of its own."""

from markupsafe import Markup

from reports.pages import page
from reports.replay import Replay, as_data


def replay_page(replays: list[Replay], plots: dict[str, str]) -> str:
    """A page of viewers, each with its plots over time.

    Args:
        replays: The scenes.
        plots: By scene: its SVG element.
    """
    return page("replay.html", replays=[(replay, as_data(replay), Markup(plots[replay.scene.name])) for replay in replays])
