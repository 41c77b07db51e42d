"""The constant words of the stories: what statuses and marks mean, and the legends below tables."""

import tomllib
from pathlib import Path
from typing import Any

WORDS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
"""By story: its texts, and its tables of texts."""
