"""Files that a stage or a recording may have left: what is absent is None, what is broken is an error."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.store import Schema, read_arrays, read_csv, read_json, read_table

if TYPE_CHECKING:
    import pandas as pd


def existing(path: Path | None) -> Path | None:
    """The path if something is there, else None."""
    return path if path is not None and path.exists() else None


def optional(folder: Path | None, name: str, schema: Schema | None = None) -> Any:
    """A file of a stage's folder, or None where the stage has not run.

    Args:
        folder: of the stage.
        name: of the file; its suffix decides how it is read.
        schema: of a Parquet table; without one, columns are taken as they are.

    Returns:
        a data frame (``.parquet``, ``.csv``), a dictionary of arrays (``.npz``) or JSON.
    """
    path = existing(folder / name if folder is not None else None)
    if path is None:
        return None
    if path.suffix == ".json":
        return read_json(path)
    if path.suffix == ".npz":
        return read_arrays(path)
    return any_table(path) if schema is None else read_table(path, schema)


def described(folder: Path | None, name: str, keys: Iterable[str], remedy: str = "run the stage again") -> Any:
    """A JSON object with the keys that the report needs, or None where the stage has not run.

    Args:
        folder: of the stage.
        name: of the file.
        keys: that it must have.
        remedy: how to make it again.

    Raises:
        InputError: the file holds something else.
    """
    content = optional(folder, name)
    if content is not None and not (isinstance(content, dict) and set(keys) <= set(content)):
        raise InputError(f"{folder}/{name}: expected an object with {', '.join(keys)}; {remedy}")
    return content


def benchmark_record(path: Path | None, keys: Iterable[str], command: str) -> Any:
    """A benchmark's record with the keys that are needed, or None where it was not made.

    Args:
        path: of the JSON file; None where none is given.
        keys: that it must have.
        command: that makes it.

    Raises:
        InputError: the file holds something else.
    """
    return None if path is None else described(path.parent, path.name, keys, f"make the record again: {command}")


def any_table(path: Path) -> pd.DataFrame:
    """A CSV or Parquet table without a declared schema.

    Raises:
        InputError: the file is absent, of another kind, or broken.
    """
    import pandas as pd

    if path.suffix == ".csv":
        return read_csv(path, "run the stage that makes it again (dvc repro)")
    try:
        if path.suffix == ".parquet":
            return pd.read_parquet(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such table; run the stage that makes it (dvc repro)") from None
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: not a readable table ({error}); delete it and run dvc repro") from None
    raise InputError(f"{path}: expected a .csv or .parquet table")
