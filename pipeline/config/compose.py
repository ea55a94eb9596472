"""Compile ``conf/`` into ``params.yaml``, and notice when the two have drifted apart.

``dvc exp run`` composes by itself; ``dvc repro`` does not (it would silently run the old values after an edit of
``conf/``), so `make repro` compiles first and ``python -m pipeline.dvc repro`` checks. Plain ``dvc repro`` checks in
the first stage of the DAG, but not where a target is named, which does not depend on that stage. The text written here
is the same, byte for byte, as the one DVC writes.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.config import from_params
from pipeline.config.schema import Config, known_keys, validate
from pipeline.errors import InputError, did_you_mean
from pipeline.store import write_text

PARAMS = Path("params.yaml")
CONF = Path("conf")


def compose(overrides: Sequence[str] = (), conf: Path = CONF) -> str:
    """Compose ``conf/`` with Hydra overrides.

    Args:
        overrides: e.g. ``["profile=smoke", "seed=2"]``.
        conf: the folder of groups.

    Returns:
        resolved YAML text.

    Raises:
        InputError: no such folder, a file in it that is not YAML, or an override Hydra refuses.
    """
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    from pipeline.config.hydra_plugins import kinds  # noqa: F401  (registers the resolvers of conf/)

    if not (conf / "config.yaml").is_file():
        raise InputError(f"{conf}/config.yaml: no such file; run from the project's top folder")
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(config_dir=str(conf.resolve()), version_base=None):
            composed = hydra_compose("config", overrides=list(overrides))
            OmegaConf.resolve(composed)
    except (YAMLError, UnicodeDecodeError) as error:
        raise InputError(_not_yaml(conf, " ".join(str(error).split()))) from None
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise InputError(f"conf/ with overrides {list(overrides)}: {_explain(str(error), overrides, conf)}") from None
    return OmegaConf.to_yaml(composed)


def _explain(message: str, overrides: Sequence[str], conf: Path) -> str:
    """Hydra's message on one line; for a key or an option that does not exist, with the nearest one that does."""
    refused = re.search(r"Could not override '([^']+)'", message)
    if refused:
        return _absent(refused.group(1), overrides, conf)
    option = re.search(r"Could not find '([^']+)/([^'/]+)'", message)
    if option:
        group, name = option.groups()
        known = [path.stem for path in (conf / group).glob("*.yaml")]
        return f"no option '{name}' in conf/{group}; {did_you_mean(name, known)}"
    lines = [line.strip() for line in message.splitlines()]
    noise = ("full_key", "object_type", "Config search", "provider", "See https")
    return " ".join(line for line in lines if line and not line.startswith(noise))


def _absent(key: str, overrides: Sequence[str], conf: Path) -> str:
    """That ``conf/`` lacks a key: how to add it where that is possible, else what is wrong with it."""
    given = [each for each in overrides if each.partition("=")[0] == key]
    others = [each for each in overrides if each not in given]
    content = yaml_text.parse(compose(others, conf)) if given else {}  # conf/ itself may be wrong
    parts, depth = key.split("."), 0
    while depth < len(parts) - 1 and isinstance(content, Mapping) and parts[depth] in content:
        content, depth = content[parts[depth]], depth + 1
    part = parts[depth]
    inside, there = list(content) if isinstance(content, Mapping) else [], parts[:depth]
    declared = known_keys(there)
    if given:
        try:
            parse(compose([*others, f"+{given[-1]}"], conf), "conf/")
            hint = did_you_mean(part, inside)
            near = f"; {hint}" if hint.startswith("did") else ""
            return f"'{key}' is not in conf/ yet{near}; what is new needs a plus: '+{given[-1]}'"
        except InputError as error:
            if part in declared or not declared:  # its value is wrong; or its name, where the value's class knows names
                return str(error).removeprefix("conf/: ").partition("\n")[0]
    strict = set(inside) <= set(declared)
    absent = "" if depth == len(parts) - 1 else f" (no '{part}' in {'.'.join(there) or 'conf/'})"
    return f"unknown key '{key}'{absent}; {did_you_mean(part, declared if strict else inside)}"


def _not_yaml(conf: Path, reason: str) -> str:
    """A sentence that names the file that Hydra could not read: its own message may not."""
    import yaml

    for path in sorted(conf.rglob("*.yaml")):
        try:
            yaml.compose(path.read_text(encoding="utf-8"))
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            return f"{path}: not valid YAML ({' '.join(str(error).split())})"
    return f"{conf}: not valid YAML ({reason})"


def parse(text: str, where: str) -> Config:
    """Read YAML text and check it against the schema.

    Raises:
        InputError: not YAML, or not what the schema allows.
    """
    import yaml

    try:
        content: Any = yaml_text.parse(text)
    except yaml.YAMLError as error:
        raise InputError(f"{where}: not valid YAML ({error})") from None
    return validate(content, where)


def load(path: Path = PARAMS) -> Config:
    """Read and check ``params.yaml``.

    Raises:
        InputError: missing, empty, not YAML, or not what the schema allows.
    """
    return validate(from_params.read(path), str(path))


def compile_params(
    overrides: Sequence[str] = (), path: Path = PARAMS, further: Callable[[Config], None] = lambda config: None
) -> bool:
    """Write ``params.yaml`` from ``conf/`` if it would change.

    Args:
        overrides: see `compose`.
        path: the file.
        further: a check beyond the schema, e.g. `pipeline.config.references.check_references`.

    Returns:
        whether the file changed.

    Raises:
        InputError: the composed values are not what the schema allows, or refer to what does not exist; nothing is
            written.
    """
    text = compose(overrides)
    further(parse(text, "conf/"))
    if path.is_file() and path.read_bytes() == text.encode():
        return False
    write_text(path, text)
    return True


def check(path: Path = PARAMS, further: Callable[[Config], None] = lambda config: None) -> None:
    """Refuse to run on a ``params.yaml`` that ``conf/`` would not give.

    Inside ``dvc exp run`` (DVC sets ``DVC_EXP_NAME``) the values may differ, since overrides were asked for; they
    are still checked against the schema.

    Args:
        path: the file.
        further: as for `compile_params`.

    Raises:
        InputError: the two differ, with the lines that do.
    """
    given = load(path)
    further(given)
    if os.environ.get("DVC_EXP_NAME"):
        return
    expected = compose([f"profile={given.profile}"])
    actual = path.read_text(encoding="utf-8")
    if expected != actual:
        lines = difflib.unified_diff(expected.splitlines(), actual.splitlines(), "conf/", str(path), n=0, lineterm="")
        shown = "\n".join(list(lines)[:20])
        raise InputError(
            f"{path} is not what conf/ with profile={given.profile} gives:\n{shown}\n"
            "run 'make params'; other values are for dvc exp run -S KEY=VALUE"
        )
