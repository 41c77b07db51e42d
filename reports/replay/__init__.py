"""The motion of a run in 3D: engines side by side or overlaid, the truth as a ghost; as a page, in the report, and as a clip."""

from reports.replay.clip import write_clip
from reports.replay.motions import Replay, replay_of
from reports.replay.page import as_data, replay_page

__all__ = ["Replay", "as_data", "replay_of", "replay_page", "write_clip"]
