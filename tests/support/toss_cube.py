"""Writes `scenarios/recordings/toss-cube.parquet` from the folder `data/tosses_processed` of github.com/DAIRLab/contact-nets.

    PYTHONPATH=tests python -m support.toss_cube contact-nets/data/tosses_processed

Source: S. Pfrommer, M. Halm, M. Posa, "ContactNets", CoRL 2020, and its README: a file holds one toss in the legacy format of PyTorch, of
which the numbers are the end; a row has position / 52.4 mm, quaternion [w, x, y, z], and 12 numbers that are not used here.
"""

import sys
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dropspin.comparisons.logs.log import SHIPPED

COLUMNS = 19
HALF_SIDE = 0.0524  # m
CHOSEN = (
    *(4, 9, 10, 12, 19, 20, 25, 29, 36, 46, 53, 61, 64, 74, 77, 82, 85, 97, 103, 105, 106, 107, 108, 111, 114, 121, 124, 128, 135, 139),
    *(144, 152, 160, 162, 181, 184, 192, 195, 203, 206, 208, 210, 212, 220, 234, 250, 251, 256, 258, 259, 276, 284, 288, 289, 291, 299),
    *(304, 309, 314, 315, 320, 324, 330, 333, 335, 338, 345, 350, 355, 366, 372, 374, 378, 382, 384, 388, 395, 404, 418, 419, 430, 432),
    *(445, 446, 450, 470, 474, 481, 483, 495, 496, 501, 502, 509, 512, 515, 550, 551, 556, 557),
)
"""Tosses with at least 12 frames before the lowest corner is below 10 mm, each once: some files repeat another one."""
POSITION_UNIT, DIGITS = 5e-6, {"x": 6, "y": 6, "z": 6, "qw": 5, "qx": 5, "qy": 5, "qz": 5}
"""Positions are rounded to 5 µm [m], and numbers to these digits after the point."""


def numbers(file: Path) -> np.ndarray:
    """The rows of a file, shape (n, 19): at the end of the file, after their count."""
    raw = file.read_bytes()
    [count] = [
        count for count in range(COLUMNS, len(raw) // 8, COLUMNS) if int.from_bytes(raw[-8 * count - 8 : -8 * count], "little") == count
    ]
    return np.frombuffer(raw[-8 * count :]).reshape(-1, COLUMNS)


def main(folder: str) -> None:
    tosses = {number: numbers(Path(folder) / f"{number}.pt") for number in CHOSEN}
    rows = np.vstack(list(tosses.values()))
    position = POSITION_UNIT * np.rint(HALF_SIDE * rows[:, :3] / POSITION_UNIT)
    quaternion = rows[:, 3:7] / np.linalg.norm(rows[:, 3:7], axis=1)[:, None]
    values = dict(zip(DIGITS, np.hstack([position, quaternion]).T, strict=True))
    columns = {
        name: pa.array([Decimal(f"{value:.{digits}f}") for value in values[name]], pa.decimal128(9, digits))
        for name, digits in DIGITS.items()
    }
    columns["toss"] = pa.array(np.repeat(list(tosses), list(map(len, tosses.values()))), pa.int32())
    pq.write_table(
        pa.table(columns),
        SHIPPED / "toss-cube.parquet",
        compression="zstd",
        compression_level=19,
        use_dictionary=False,
        column_encoding=dict.fromkeys(columns, "DELTA_BINARY_PACKED"),
        store_decimal_as_integer=True,
    )


if __name__ == "__main__":
    main(sys.argv[1])
