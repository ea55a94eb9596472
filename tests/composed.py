"""Configurations for tests of something else: each is composed once a process, which takes most of a second."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from pipeline import yaml_text
from pipeline.config import compose as composing
from pipeline.config.compose import CONF, compose
from pipeline.config.schema import Config, validate
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[1]


@functools.cache
def _text(*overrides: str) -> str:
    return compose(overrides, ROOT / "conf")


def content(*overrides: str) -> dict[str, Any]:
    """What ``conf/`` gives with these overrides, as nested mappings of the caller's own."""
    return yaml_text.parse(_text(*overrides))


def config(*overrides: str) -> Config:
    """What ``conf/`` gives with these overrides, checked against the schema."""
    return validate(content(*overrides), "conf/")


def graph() -> dict[str, Any]:
    """What ``dvc.yaml`` holds."""
    return yaml_text.parse((ROOT / "dvc.yaml").read_text(encoding="utf-8"))


@contextlib.contextmanager
def remembered() -> Iterator[None]:
    """Have the package compose the same overrides of the same files once, also where it refuses them.

    For tests in which neither installed packages change, nor files that overrides name. A test that imports `compose`
    itself composes anew.
    """
    known = dict[tuple[Any, ...], str | InputError]()

    def once(overrides: Sequence[str] = (), conf: Path = CONF) -> str:
        files = [(path, path.stat()) for path in sorted(conf.rglob("*.yaml"))]
        state = tuple((path, status.st_mtime_ns, status.st_size) for path, status in files)
        key = (tuple(overrides), os.path.realpath(conf), state)
        if key not in known:
            try:
                known[key] = compose(overrides, conf)
            except InputError as error:
                known[key] = error
        result = known[key]
        if isinstance(result, InputError):
            raise InputError(str(result))
        return result

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(composing, "compose", once)
        yield
