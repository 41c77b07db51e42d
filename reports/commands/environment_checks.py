"""What commands need of the environment. It is checked before libraries are loaded, which end with a traceback or abort otherwise."""

import os
import re
import sys

GIB = 2**30
ADDRESS_SPACE = GIB
"""The address space that the libraries and two engines need on two processors [bytes]; more processors need more."""


def problem() -> str:
    """What prevents every command, and the remedy; empty if nothing does."""
    try:
        os.getcwd()
    except OSError:
        return "the working directory does not exist any more; change to another one"
    threads = os.environ.get("NUMBA_NUM_THREADS", "")
    if re.fullmatch(r"\s*(-\d+|0+)\s*", threads):
        return f"NUMBA_NUM_THREADS: got {threads!r}; give a whole number above 0, or unset it"
    if (limit := limited_to()) is not None and limit < ADDRESS_SPACE:
        return f"{shortage(limit)}; {ADDRESS_SPACE / GIB:g} GiB is the least that is needed"
    return ""


def limited_to() -> int | None:
    """The limit of this process's address space [bytes]; None if there is none."""
    if sys.platform == "win32":
        return None
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def shortage(limit: int | None) -> str:
    """That memory is short, and the remedy."""
    return "not enough memory" if limit is None else f"the address space is limited to {limit / GIB:.2g} GiB; raise the limit (ulimit -v)"
