"""A hash of the package's sources, taken before any of them is imported.

Without it, an edit between the import and the first compilation would cache kernels of the old code under the hash of the new one.
"""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).parent

_named = (str(source.relative_to(PACKAGE)).encode() + b"\0" + source.read_bytes() for source in sorted(PACKAGE.rglob("*.py")))
HASH = hashlib.sha256(b"".join(_named)).hexdigest()
