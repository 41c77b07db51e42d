"""The motions of a run in 3D, engines side by side or overlaid, with the exact solution dashed: the data for a page, or a GIF."""

from dropspin.reports.replay.data import as_data
from dropspin.reports.replay.motions import Replay, replay_of

__all__ = ["Replay", "as_data", "replay_of"]
