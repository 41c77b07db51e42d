"""Reading of input files: only regular files of a limited size."""

from pathlib import Path

from dropspin.scenarios.errors import DropspinError


def read_file(path: Path, name: str, kind: str, largest: int) -> bytes:
    """The content of a regular file. A pipe or a device is refused before it is opened, because reading it might never end.

    Args:
        path: The file.
        name: The path as the user gave it, for messages.
        kind: The word for this kind of file in messages.
        largest: Largest allowed size [bytes].

    Raises:
        DropspinError: The path is not a regular file, the file is too large, or it cannot be read.
    """
    try:
        if path.is_dir():
            raise DropspinError(f"{name}: is a directory; a {kind} is one file, so give its path.")
        path.stat()  # raises the error of an absent file
        if not path.is_file():
            raise DropspinError(f"{name}: is a pipe or a device; a {kind} is a regular file.")
        with path.open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise DropspinError(f"{name}: {error.strerror}; give the path of a readable file.") from None
    except ValueError:
        raise DropspinError(f"{name!r}: this cannot be the name of a file.") from None
    if len(content) > largest:
        raise DropspinError(f"{name}: larger than {largest:,} bytes, the limit for a {kind}.")
    return content
