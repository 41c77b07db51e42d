"""The columns of a recording's data as arrays, from CSV, Parquet, NPZ or MCAP; what is wrong with such a file is one line."""

import codecs
import io
import json
import warnings
import zipfile
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib import format as npy
from numpy.typing import NDArray

from dropspin.comparisons.engines.packages import install_extra
from dropspin.scenarios.errors import DropspinError, did_you_mean
from dropspin.scenarios.files import read_file
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import printable
from dropspin.scenarios.validation import shown

POSITION = ("x", "y", "z")
ORIENTATION = ("qx", "qy", "qz", "qw")
VELOCITY = ("vx", "vy", "vz")
SPIN = ("wx", "wy", "wz")
TOSS = "toss"
NUMBERS = ("t", *POSITION, *ORIENTATION, *VELOCITY, *SPIN)
REQUIRED = {*POSITION, *ORIENTATION}
LARGEST_FILE = 200_000_000  # bytes
MOST_ROWS = 1_000_000
SEPARATORS = {";": "semicolons", "\t": "tabs", " ": "spaces"}
"""That a table may have instead of commas."""
LONGEST_NAME = 100
"""Characters of the name of a toss."""
NO_NUMBER = ["", "nan", "NaN", "NA", "N/A", "null", "None"]
"""What programs write where they have none; as the name of a toss it is a text."""
Columns = dict[str, Any]
"""By name, a sequence of one value a row."""


def read_columns(path: Path, given: str, topic: str | None) -> tuple[dict[str, Array], NDArray[np.str_]]:
    """The columns of a file of data.

    Args:
        path: The file.
        given: The path as the user gave it, for messages.
        topic: The topic of an MCAP file; None if it has only one topic.

    Returns:
        The columns of numbers by name, and the names of the tosses, each of one length; all numbers are finite.

    Raises:
        DropspinError: The file is absent, damaged, too large or of another format, or has other columns, or values that are no numbers.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise DropspinError(f"{given}: is not the data of a recording; give a file that ends in {', '.join(FORMATS)}.")
    raw = read_file(path, given, "recording", LARGEST_FILE)
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DropspinError(f"{given}: is text in UTF-16; save it as UTF-8.")
    try:
        columns = FORMATS[ending](raw, topic)
    except DropspinError as error:
        raise DropspinError(f"{given}: {error}") from None
    except Exception as error:  # whatever the libraries raise for a damaged file
        detail = printable(" ".join(str(error).split()) or type(error).__name__)
        raise DropspinError(f"{given}: is not {ending[1:].upper()}, or damaged: {detail:.200}.") from None
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DropspinError(f"{given}: the columns have different lengths: {shown(lengths)}; give one value a row.")
    count = lengths["x"]
    names = _names(given, columns.pop(TOSS, ["1"] * count))
    return {name: _numbers(given, name, values) for name, values in columns.items()}, names


def _verify(names: Collection[str], rows: int = 0) -> None:
    """Raise `DropspinError` for other columns than those of a recording, or too many rows."""
    known = (*NUMBERS, TOSS)
    for name in names:
        if name not in known:
            raise DropspinError(f"column {shown(name)} is unknown.{did_you_mean(name, known)} Allowed: {', '.join(known)}.")
    partly = {name for group in (VELOCITY, SPIN) if not set(group).isdisjoint(names) for name in group}
    if missing := [name for name in NUMBERS if name in REQUIRED | partly and name not in names]:
        raise DropspinError(f"has no column {', '.join(missing)}; {'it has ' + ', '.join(names) if names else 'it has none'}.")
    if rows > MOST_ROWS:
        raise DropspinError(f"has more than {MOST_ROWS:,} rows, the limit for a recording; give fewer tosses.")


def _verify_first_line(names: Sequence[str]) -> None:
    """Raise `DropspinError` for names of columns that show another separator, no name, or one name twice."""
    for sign, word in SEPARATORS.items():
        if len(names) == 1 and sign in names[0]:
            raise DropspinError(
                f"column {shown(names[0])} is unknown: {word} separate the values; separate them by commas, and write decimals "
                "with a point."
            )
    for number, name in enumerate(names):
        if not name:
            where = "the first line ends in a separator; leave it out there and in all rows"
            other = "; leave it out, as the number of a row, or name it"
            raise DropspinError(f"column {number + 1} has no name{': ' + where if not any(names[number:]) else other}.")
        if name in names[:number]:
            raise DropspinError(
                f"column {shown(name)} is there twice; give each column once, and the names of the columns in the first line alone."
            )


def _csv(raw: bytes, _topic: str | None) -> Columns:
    first = pd.read_csv(io.BytesIO(raw), nrows=1, header=None, skipinitialspace=True, dtype=str, keep_default_na=False)
    names = list(map(str, first.iloc[0]))
    _verify_first_line(names)
    _verify(names)
    options: dict[str, Any] = {
        "dtype": {TOSS: str},
        "low_memory": False,
        "keep_default_na": False,
        "na_values": dict.fromkeys(NUMBERS, NO_NUMBER),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # it would leave out values
        try:
            table = pd.read_csv(io.BytesIO(raw), nrows=MOST_ROWS + 1, index_col=False, skipinitialspace=True, **options)
        except pd.errors.ParserWarning:
            raise DropspinError("rows have more values than the first line has names; name every column.") from None
    _verify(names, len(table))
    return {name: table[name] for name in names}


def _parquet(raw: bytes, _topic: str | None) -> Columns:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(io.BytesIO(raw))
    names = [name for name in file.schema_arrow.names if not name.startswith("__index_level_")]  # pandas stores the index of a table so
    _verify(names, file.metadata.num_rows)
    table = file.read(names)
    # Decimals, which are integers with a unit of 0.1^n, are as small as integers and stay what their writer rounded to.
    decimals = {name for name in table.column_names if pa.types.is_decimal(table.schema.field(name).type)}
    return {name: (table[name].cast(pa.float64()) if name in decimals else table[name]).to_pandas() for name in table.column_names}


def _npz(raw: bytes, _topic: str | None) -> Columns:
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        _verify([name.removesuffix(".npy") for name in archive.namelist()])
        for name in archive.namelist():
            with archive.open(name) as member:  # its head alone, which says how large it is
                read_head = npy.read_array_header_1_0 if npy.read_magic(member) == (1, 0) else npy.read_array_header_2_0
                shape, _, dtype = read_head(member)
            if len(shape) != 1 or dtype.kind not in "fiuU" or dtype.itemsize > 4 * LONGEST_NAME:
                raise DropspinError(f"{name.removesuffix('.npy')} has shape {shape} and type {dtype}; give one number a row.")
            _verify(list(NUMBERS), shape[0])
    with np.load(io.BytesIO(raw), allow_pickle=False) as arrays:
        return dict(arrays)


def _mcap(raw: bytes, topic: str | None) -> Columns:
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise DropspinError(f"MCAP files need a package that is not installed: {install_extra('mcap')}.") from None
    rows: list[Any] = []
    topics, names = dict[str, None](), dict[str, None]()
    for _, channel, message in make_reader(io.BytesIO(raw)).iter_messages(topic, log_time_order=False):
        topics[channel.topic] = None
        rows.append(json.loads(message.data) if channel.message_encoding == "json" else None)
        if len(topics) > 1:
            raise DropspinError(f"has several topics ({', '.join(topics)}); name one in the header, as topic.")
        if not isinstance(rows[-1], dict):
            raise DropspinError(f"a message of topic {channel.topic} is not a JSON object of the columns.")
        names.update(dict.fromkeys(rows[-1]))  # a column that only some messages have lacks numbers
        _verify(names, len(rows))
    if not rows:
        raise DropspinError(f"has no message{'' if topic is None else f' of topic {topic}'}.")
    return dict(pd.DataFrame.from_records(rows, columns=list(names)))


FORMATS: dict[str, Callable[[bytes, str | None], Columns]] = {".csv": _csv, ".parquet": _parquet, ".npz": _npz, ".mcap": _mcap}
"""By the ending of the file: the function from its content and the topic to the columns."""


def _numbers(given: str, name: str, values: Any) -> Array:
    """A column as numbers, all finite."""
    column = pd.Series(values)
    numbers = pd.to_numeric(column, errors="coerce")
    if column.dtype in (bool, object):
        numbers = numbers.mask(np.array([isinstance(value, bool) for value in column.tolist()], dtype=bool))
    found = numbers.to_numpy(dtype=float, na_value=np.nan)
    if not (finite := np.isfinite(found)).all():
        row = int(np.argmin(finite))
        value: Any = column.iloc[row : row + 1].tolist()[0]  # as a number of Python
        text: str = "no number" if pd.isna(value) else shown(value)
        raise DropspinError(f"{given}: column {name}: row {row + 1} has {text}; give a finite number, or leave out rows without tracking.")
    return found


def _names(given: str, values: Any) -> NDArray[np.str_]:
    """The names of tosses: numbers or texts, of which different ones stay different."""
    column = pd.Series(values)
    whole = [int(value) if isinstance(value, float) and value.is_integer() else value for value in column.tolist()]
    names = ["" if is_missing else str(value) for value, is_missing in zip(whole, column.isna(), strict=True)]
    for row, name in enumerate(names, 1):
        if not 0 < len(name) <= LONGEST_NAME:
            what = f"a name of {len(name)} characters" if name else "no name"
            raise DropspinError(
                f"{given}: column {TOSS}: row {row} has {what}; give a number or a text of up to {LONGEST_NAME} characters."
            )
    return np.array(names)
