"""``params.yaml`` is checked before stages run: ``conf/`` gives it, and ``dvc.yaml`` lists the code that it chooses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.errors import InputError

GRAPH, PARAMS = Path("dvc.yaml"), Path("params.yaml")


def check_params() -> None:
    """Refuse a ``params.yaml`` that ``conf/`` does not give, or whose estimators ``dvc.yaml`` does not know.

    The stage `config` compares with ``conf/`` too, but is no stage that a target depends on, and DVC knows nothing of
    third parties' packages, whose hashes are in ``params.yaml``.

    Raises:
        InputError: see `pipeline.config.compose.check` and `check_names`.
    """
    from pipeline.config.compose import CONF, check
    from pipeline.config.references import check_references

    if CONF.is_dir():
        check(further=check_references)
        check_names(yaml_text.parse(PARAMS.read_text(encoding="utf-8")))


def check_names(params: Any, compiled: str = "", more: str = "") -> None:
    """Refuse parameters that choose what ``dvc.yaml`` does not list as code of a stage: its edits would go unnoticed.

    Args:
        params: content of ``params.yaml``.
        compiled: command that makes this content of ``conf/`` first, where it is not that of the file.
        more: end of the message.

    Raises:
        InputError: one line.
    """
    from pipeline.dependencies.dvc_yaml import unlisted

    if not GRAPH.is_file():
        return
    names = unlisted(yaml_text.parse(GRAPH.read_text(encoding="utf-8")), params, Path.cwd())
    if names:
        steps = [compiled] if compiled else []
        steps.append("python -m pipeline.dependencies --write")
        raise InputError(
            f"{GRAPH}: deps lack the code of what the parameters choose ({'; '.join(names)}), whose changes DVC would "
            f"not notice; run '{' && '.join(steps)}'{more}"
        )
