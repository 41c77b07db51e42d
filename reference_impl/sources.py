"""What the package's kernels are compiled from, taken down before any of it is imported.

An edit between the import and the first compilation must not file old code under the new text's name.
"""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).parent


def _hash_of_sources() -> str:
    digest = hashlib.sha256()
    for source in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(source.relative_to(PACKAGE)).encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()


HASH = _hash_of_sources()
