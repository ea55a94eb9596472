"""``python -m pipeline.config [KEY=VALUE ...]`` compiles ``params.yaml``; ``--check`` compares; ``--schema`` prints."""

from __future__ import annotations

import json
import sys

from pipeline.config.compose import check, compile_params
from pipeline.config.overrides import parsed
from pipeline.config.references import check_references
from pipeline.config.schema import Config
from pipeline.errors import InputError


def main(arguments: list[str]) -> int:
    """Run one of the three; returns the exit status."""
    try:
        if arguments == ["--schema"]:
            print(json.dumps(Config.model_json_schema(), indent=2))
        elif arguments == ["--check"]:
            check(further=check_references)
        elif any(argument.startswith("-") for argument in arguments):
            raise InputError(f"{' '.join(arguments)}: expected KEY=VALUE ..., --check or --schema")
        elif compile_params([each.input_line for each in parsed(arguments)], further=check_references):
            print("params.yaml written from conf/")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
