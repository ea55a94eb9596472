"""Files: written beside their place and renamed into it, the same bytes for the same content.

Tables are tidy, long-format Parquet with a declared schema; small results are JSON with sorted keys; arrays
are ``.npz``. A reader never sees a half-written file, and a table that lacks a column, or holds an unknown
one, is refused by name. A folder is replaced as a whole: a reader sees the earlier one, the new one, or between two
renames none, and the earlier one is deleted once the new one is in its place.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

_UMASK = os.umask(0o077)
"""Permissions that new files do not get; the system gives it only for another one."""
os.umask(_UMASK)
FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
"""Errors of the system where nothing more can be written."""


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``; rename it into place if the block ends without an error.

    The suffix is kept, since many writers choose their format by it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".writing-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_UMASK)
        temporary.replace(path)
    except OSError as error:
        _name(error, path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replacing_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder beside ``path``; put it in ``path``'s place if the block ends without an error.

    A process that is killed between the two renames leaves the earlier folder beside it, in ``.replaced-NAME-...``;
    the next one that is complete removes it.

    Args:
        path: of the folder; whole at any time, or absent.

    Raises:
        OSError: the system refuses a rename, and ``path`` is what it was; or the earlier folder cannot be deleted, and
            ``path`` is new.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=".writing-"))
    try:
        yield temporary
        temporary.chmod(0o777 & ~_UMASK)
        if path.is_dir():
            _exchange(temporary, path)
        else:
            temporary.replace(path)
    except OSError as error:
        _name(error, path)
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for leftover in _replaced(path):
        shutil.rmtree(leftover)


def file_sha256(path: str | Path) -> str:
    """SHA-256 of a file's content, hexadecimal."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _name(error: OSError, path: Path) -> None:
    """Give an error of a full disk, which names no file, the name of what was being written."""
    if error.errno in FULL and error.filename is None:
        error.filename = str(path)


def _exchange(new: Path, path: Path) -> None:
    """Move a folder aside and a new one into its place, or leave it where it is."""
    aside = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".replaced-{path.name}-"))
    try:
        path.rename(aside / path.name)
        try:
            new.rename(path)
        except OSError:
            (aside / path.name).rename(path)
            raise
    except OSError:
        with contextlib.suppress(OSError):  # not empty where the system refused this rename too: nothing is lost
            aside.rmdir()
        raise


def _replaced(path: Path) -> list[Path]:
    """Folders that `_exchange` moved the earlier ones of this name into, those of killed processes among them."""
    beside = path.parent.glob(".replaced-*")
    return [folder for folder in beside if folder.name.rpartition("-")[0] == f".replaced-{path.name}"]


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text with Unix line ends."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def plain_json(value: Any) -> Any:
    """A value as JSON holds it: arrays become lists; NaN and infinity, which JSON has not, become None."""
    if isinstance(value, Mapping):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_json(item) for item in value]
    if hasattr(value, "tolist"):
        return plain_json(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(path: str | Path, content: Any) -> None:
    """Write JSON with sorted keys, an indent of two and a final newline; NaN and infinity become null."""
    write_text(path, json.dumps(plain_json(content), indent=2, sort_keys=True, ensure_ascii=False) + "\n")


def read_json(path: str | Path) -> Any:
    """Read JSON.

    Raises:
        InputError: the file is missing or not JSON.
    """
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; run the stage that makes it (dvc repro)") from None
    except RecursionError:
        raise InputError(f"{path}: not valid JSON (nested too deeply); delete it and run dvc repro") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # of the decoder, or not UTF-8
        raise InputError(f"{path}: not valid JSON ({error}); delete it and run dvc repro") from None


ESTIMATE_DECIMALS = {
    "sigma_dn": 4,
    "low_dn": 4,
    "high_dn": 4,
    "mtf": 5,
    "low": 5,
    "high": 5,
    "estimate": 5,
}
"""Decimals of estimates in tables that name their estimator (column ``estimator``): a thousand times finer than the
error of the best one (0.3 DN; 1 % of MTF), coarser than what another processor's order of additions changes."""


@dataclass(frozen=True)
class Schema:
    """The declared columns of one table; estimates in it are rounded to `ESTIMATE_DECIMALS`.

    Attributes:
        name: what the table is called in messages.
        columns: column name -> pandas dtype (``"string"``, ``"int64"``, ``"float64"``, ``"bool"`` ...).
        units: column name -> unit, for those that have one; shown in reports.
        rounds: whether estimates are rounded; not so in a table that is never stored.
    """

    name: str
    columns: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    rounds: bool = True

    def conform(self, table: pd.DataFrame, where: str = "") -> pd.DataFrame:
        """The table with exactly the declared columns, in order, in the declared types; estimates are rounded.

        Raises:
            InputError: a column is missing, unknown, or cannot be read as its type.
        """
        prefix = f"{where}: " if where else ""
        missing = [name for name in self.columns if name not in table.columns]
        unknown = [name for name in table.columns if name not in self.columns]
        if missing or unknown:
            raise InputError(
                f"{prefix}table '{self.name}' expects columns {list(self.columns)}; missing {missing}, "
                f"unknown {unknown}"
            )
        try:
            typed = table[list(self.columns)].astype(dict(self.columns)).reset_index(drop=True)
        except (TypeError, ValueError) as error:
            raise InputError(f"{prefix}table '{self.name}': {printable(error)}") from None
        return typed.round(self.decimals)

    @property
    def decimals(self) -> dict[str, int]:
        """Decimals of the columns that hold estimates; empty for a table without a column ``estimator``."""
        if not self.rounds or "estimator" not in self.columns:
            return {}
        return {name: digits for name, digits in ESTIMATE_DECIMALS.items() if self.columns.get(name) == "float64"}


def write_table(path: str | Path, table: pd.DataFrame, schema: Schema) -> None:
    """Write a table as Parquet after checking it against its schema."""
    table = schema.conform(table, str(path))
    with replacing(path) as temporary:
        table.to_parquet(temporary, index=False, compression="zstd")


def read_table(path: str | Path, schema: Schema) -> pd.DataFrame:
    """Read a Parquet table and check it against its schema.

    Raises:
        InputError: the file is missing, not Parquet, or has other columns.
    """
    import pandas as pd
    import pyarrow as pa

    try:
        table = pd.read_parquet(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such table; run the stage that makes it (dvc repro)") from None
    except (pa.ArrowInvalid, OSError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: not a Parquet table ({reason}); delete it and run dvc repro") from None
    return schema.conform(table, str(path))


def read_csv(path: str | Path, remedy: str, text: Mapping[str, str] | None = None) -> pd.DataFrame:
    """Read a CSV table.

    Args:
        path: the file.
        remedy: what mends a file that is missing or broken, for the message.
        text: columns of text -> their type; others are told by their cells.

    Raises:
        InputError: the file is missing or no CSV table.
    """
    import pandas as pd

    try:
        return pd.read_csv(path, dtype=dict(text or {}))
    except FileNotFoundError:
        raise InputError(f"{path}: no such table; {remedy}") from None
    except (OSError, ValueError) as error:  # pandas' errors of parsing and of encoding are ValueErrors
        raise InputError(f"{path}: not a CSV table ({printable(str(error).strip())}); {remedy}") from None


def read_published(path: str | Path, columns: Mapping[str, type]) -> pd.DataFrame:
    """Read a CSV of published numbers, which people may edit.

    Args:
        path: the file.
        columns: columns that must be there -> ``str``, or ``float`` for numbers (empty cells are NaN); further
            columns are kept as they are.

    Raises:
        InputError: the file is missing or no CSV, a column is missing, or a cell is not a number; names the line.
    """
    import pandas as pd

    restore = "restore it from git (git checkout data/paper)"
    table = read_csv(path, restore)
    for name, kind in columns.items():
        if name not in table.columns:
            present = ", ".join(map(printable, table))
            raise InputError(f"{path}: column '{name}' is missing; there are {present}; {restore}")
        if kind is float and not pd.api.types.is_numeric_dtype(table[name]):
            numbers = pd.to_numeric(table[name], errors="coerce")
            wrong = table.index[numbers.isna() & table[name].notna()]
            if len(wrong):
                cell = table[name][wrong[0]]
                raise InputError(f"{path}, line {wrong[0] + 2}: {name} is {cell!r}, expected a number; {restore}")
            table[name] = numbers.astype(float)
    return table


def write_arrays(path: str | Path, **arrays: np.ndarray) -> None:
    """Write named arrays as compressed ``.npz``; the bytes depend on the content only."""
    import numpy as np

    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_arrays(path: str | Path, remedy: str = "delete it and run dvc repro") -> dict[str, np.ndarray]:
    """Read the arrays of an ``.npz`` file (pickled objects are refused).

    Args:
        path: the file.
        remedy: for a broken file, as the error states it.

    Returns:
        arrays by name.

    Raises:
        InputError: the file is missing or broken.
    """
    import zipfile
    import zlib

    import numpy as np

    try:
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            raise ValueError("a single .npy array")
        with archive:
            return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; run the stage that makes it (dvc repro)") from None
    except MemoryError:
        reason = "it declares more than fits into memory"
        raise InputError(f"{path}: not a readable .npz archive ({reason}); {remedy}") from None
    except (zipfile.BadZipFile, zlib.error, ValueError, OSError, EOFError, KeyError, NotImplementedError) as error:
        raise InputError(f"{path}: not a readable .npz archive ({error}); {remedy}") from None


def write_image(path: str | Path, image: np.ndarray) -> None:
    """Write an 8- or 16-bit image, or a float image in [0, 1] as 8 bit (rounded, not truncated).

    Args:
        path: PNG, TIFF or JPEG by its suffix.
        image: (H, W) or (H, W, 3) RGB; uint8, uint16, or float in [0, 1].

    Raises:
        InputError: the suffix is not one of a picture format.
        OSError: the system refuses to write, for example because the disk is full.
    """
    import cv2
    import numpy as np

    if image.dtype.kind == "f":
        image = np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
    if image.ndim == 3:
        image = image[..., ::-1]
    try:
        encoded, content = cv2.imencode(Path(path).suffix, np.ascontiguousarray(image))
    except cv2.error:
        encoded = False
    if not encoded:
        raise InputError(f"{path}: OpenCV cannot write such an image; expected the suffix of a picture format")
    with replacing(path) as temporary:
        temporary.write_bytes(content.tobytes())
