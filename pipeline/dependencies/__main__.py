"""``python -m pipeline.dependencies --check`` verifies code dependencies in ``dvc.yaml``, ``--write`` sets them."""

from __future__ import annotations

import sys
from pathlib import Path

from pipeline import yaml_text
from pipeline.errors import InputError
from pipeline.store import write_text

GRAPH, PARAMS = Path("dvc.yaml"), Path("params.yaml")


def main(arguments: list[str]) -> int:
    """Run one of the two; returns the exit status."""
    from pipeline.dependencies.dvc_yaml import differences, rewritten

    try:
        if arguments not in (["--check"], ["--write"]):
            raise InputError(f"{' '.join(arguments)}: expected --check or --write")
        for path in (GRAPH, PARAMS):
            if not path.is_file():
                raise InputError(f"{path}: no such file; run from the project's top folder")
        text = GRAPH.read_text(encoding="utf-8")
        params = yaml_text.parse(PARAMS.read_text(encoding="utf-8"))
        if arguments == ["--write"]:
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
    raise SystemExit(main(sys.argv[1:]))
