"""Arrays in .npz files: numbers only, of expected shapes, which are verified before the numbers are read."""

import io
import math
from collections.abc import Mapping
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Shapes = Mapping[str, tuple[int, ...]]
"""By name of the array."""
FORMAT = (1, 0)
"""Of NumPy's header; the others are for headers of more than 64 KiB."""


def stored_arrays(arrays: Mapping[str, object]) -> bytes:
    """Arrays as the content of a .npz file."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **{name: np.asarray(one, dtype=np.float64) for name, one in arrays.items()})
    return content.getvalue()


def loaded_arrays(content: bytes, shapes: Shapes) -> dict[str, Array]:
    """The arrays in a .npz file.

    Args:
        content: The content of the file.
        shapes: Names and shapes of the arrays.

    Raises:
        ValueError: It has other arrays, or is damaged.
    """
    with ZipFile(io.BytesIO(content)) as archive:
        if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in shapes):
            raise ValueError(f"has other arrays than {', '.join(shapes)}")
        return {name: _array(archive, name, shape) for name, shape in shapes.items()}


def _array(archive: ZipFile, name: str, shape: tuple[int, ...]) -> Array:
    with archive.open(f"{name}.npy") as file:
        if np.lib.format.read_magic(file) != FORMAT:
            raise ValueError(f"{name}: a format that dropspin does not write")
        given, in_columns, dtype = np.lib.format.read_array_header_1_0(file)
        if dtype != np.dtype("<f8") or given != shape:
            raise ValueError(f"{name}: has type {dtype} and shape {given}; must have float64 and {shape}")
        data = file.read(8 * math.prod(shape))
        if file.read(1):
            raise ValueError(f"{name}: has more numbers than its shape {shape}")
    return np.frombuffer(bytearray(data), dtype="<f8").reshape(shape, order="F" if in_columns else "C")
