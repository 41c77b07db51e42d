"""Arrays in .npz files: numbers only, of expected shapes, which are verified before the numbers are read."""

import io
import math
from collections.abc import Mapping
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Shapes = Mapping[str, tuple[int | None, ...]]
"""By name of the array; None is the number of rows, which all arrays share."""
FORMAT = (1, 0)
"""Of NumPy's header; the others are for headers of more than 64 KiB."""


def stored_arrays(arrays: Mapping[str, object]) -> bytes:
    """Arrays as the content of a .npz file."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **{name: np.asarray(one, dtype=np.float64) for name, one in arrays.items()})
    return content.getvalue()


def loaded_arrays(content: bytes, shapes: Shapes, most: float) -> dict[str, Array]:
    """The arrays in a .npz file.

    Args:
        content: The content of the file.
        shapes: Names and shapes of the arrays.
        most: Largest number of rows.

    Raises:
        ValueError: It has other arrays, or is damaged.
    """
    with ZipFile(io.BytesIO(content)) as archive:
        if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in shapes):
            raise ValueError(f"has other arrays than {', '.join(shapes)}")
        found = {name: _array(archive, name, shape, most) for name, shape in shapes.items()}
    if len({len(found[name]) for name, shape in shapes.items() if None in shape}) > 1:
        raise ValueError("its arrays have different lengths")
    return found


def _array(archive: ZipFile, name: str, shape: tuple[int | None, ...], most: float) -> Array:
    with archive.open(f"{name}.npy") as file:
        if np.lib.format.read_magic(file) != FORMAT:
            raise ValueError(f"{name}: a format that dropspin does not write")
        given, in_columns, dtype = np.lib.format.read_array_header_1_0(file)
        rows = given[0] if given and shape[:1] == (None,) and 0 < given[0] <= most else -1
        if dtype != np.dtype("<f8") or given != tuple(rows if one is None else one for one in shape):
            raise ValueError(f"{name}: has type {dtype} and shape {given}")
        data = file.read(8 * math.prod(given))
        if file.read(1):
            raise ValueError(f"{name}: has more numbers than its shape {given}")
    return np.frombuffer(bytearray(data), dtype="<f8").reshape(given, order="F" if in_columns else "C")
