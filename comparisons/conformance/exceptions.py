"""What an adapter raised: the exception with the adapter's own line, and the whole traceback."""

import os
import sys
import traceback

from dropspin.comparisons.engines import exceptions
from dropspin.comparisons.engines.base import Engine


def described(error: Exception, engine: Engine) -> str:
    """The type and the text of an exception, and the innermost line of the adapter's file that it passed through, if any."""
    file = getattr(sys.modules.get(type(engine).__module__), "__file__", None)
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    where = f" ({os.path.relpath(own[-1].filename)}:{own[-1].lineno}, in {own[-1].name})" if own else ""
    return exceptions.described(error) + where


def whole_traceback(error: Exception) -> str:
    """The traceback of an exception, or of its cause if it has one."""
    cause = error.__cause__ or error
    return "".join(traceback.format_exception(cause))
