"""Settings that all tests share."""

import os

from hypothesis import settings

# Numerical properties are cheap but not uniform in time; a deadline would test the machine.
settings.register_profile("default", deadline=None, max_examples=40, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))
