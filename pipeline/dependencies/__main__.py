"""``python -m pipeline.dependencies --check`` verifies code dependencies in ``dvc.yaml``, ``--write`` sets them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline import yaml_text
from pipeline.errors import InputError
from pipeline.store import write_text

GRAPH, PARAMS = Path("dvc.yaml"), Path("params.yaml")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the two; returns the exit status: 1 where `--check` meets a difference, 2 for wrong input."""
    import yaml

    from pipeline.dependencies.dvc_yaml import differences, rewritten

    parser = argparse.ArgumentParser(
        prog="python -m pipeline.dependencies", description="Code dependencies of the stages in dvc.yaml."
    )
    modes = parser.add_mutually_exclusive_group(required=True)
    modes.add_argument("--check", action="store_true", help="name each line that is missing or too many")
    modes.add_argument("--write", action="store_true", help="set them in place")
    options = parser.parse_args(arguments)
    try:
        for path in (GRAPH, PARAMS):
            if not path.is_file():
                raise InputError(f"{path}: no such file; run from the project's top folder")
        text = GRAPH.read_text(encoding="utf-8")
        try:
            params = yaml_text.parse(PARAMS.read_text(encoding="utf-8"))
        except (yaml.YAMLError, UnicodeDecodeError):
            raise InputError(f"{PARAMS}: not valid YAML; run 'make params' to compile it from conf/") from None
        if options.write:
            written = rewritten(text, params, Path.cwd())
            if written != text:
                write_text(GRAPH, written)
                print(f"{GRAPH}: code dependencies written")
            return 0
        problems = differences(text, params, Path.cwd())
        for problem in problems:
            print(problem, file=sys.stderr)
        if problems:
            print("run 'python -m pipeline.dependencies --write'", file=sys.stderr)
        return 1 if problems else 0
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    raise SystemExit(main())
