"""Reading files that somebody else may have written: regular files only, of a limited size."""

from pathlib import Path

from scenarios.errors import DropspinError


def read_file(path: Path, given: str, what: str, largest: int) -> bytes:
    """The content of a regular file. A pipe or a device is refused before it is opened: reading it could last for ever.

    Args:
        path: The file.
        given: The path as the user gave it, for messages.
        what: The word for such a file, for messages.
        largest: Largest allowed size [bytes].

    Raises:
        DropspinError: It is not a regular file, is too large, or cannot be read.
    """
    try:
        if path.is_dir():
            raise DropspinError(f"{given}: is a directory; a {what} is one file.")
        path.stat()  # raises the error of an absent file
        if not path.is_file():
            raise DropspinError(f"{given}: is a pipe or a device; a {what} is a regular file.")
        with path.open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise DropspinError(f"{given}: {error.strerror}; give the path of a readable file.") from None
    except ValueError:
        raise DropspinError(f"{given!r}: no file has such a name.") from None
    if len(content) > largest:
        raise DropspinError(f"{given}: more than {largest:,} bytes; no {what} is that long.")
    return content
