"""Files of folders that somebody else may have written: reading and naming them."""

import hashlib
import re
from pathlib import Path

LONGEST_NAME = 60


def read_stored(folder: Path, name: str) -> bytes:
    """The content of a file in a folder.

    Raises:
        ValueError: It is no regular file: reading a pipe or a device could last for ever.
        OSError: It cannot be read.
    """
    path = folder / name
    path.stat()  # raises the error of an absent file
    if not path.is_file():
        raise ValueError(f"{name} is not a regular file")
    return path.read_bytes()


def sha256(content: bytes) -> str:
    """The SHA-256 of a content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def file_name(text: str) -> str:
    """A text, such as the name of a scene, as a file name without its ending: different texts have different names.

    A text that any file system accepts is its own name; of another, the other characters are replaced and a hash is added.
    """
    if len(text) <= LONGEST_NAME and re.fullmatch(r"[A-Za-z0-9=][A-Za-z0-9.=_-]*", text):
        return text
    kept = re.sub(r"[^A-Za-z0-9.=]+", "-", text).strip("-.")[:LONGEST_NAME]
    return f"{kept}-{sha256(text.encode(errors='surrogatepass'))[:8]}".lstrip("-")
