"""Records what a stage process executed and opened; on PYTHONPATH, Python imports this before anything else.

With the environment variable RECORD_STAGES naming a folder, every process of a stage (``python -m pipeline.stages.X``)
and its workers write one JSON there when they end: modules of the package, and files of the project that were opened.
A child of the server that `pipeline.dvc.preloaded` runs stages in becomes a stage's process with its audit event.
"""

import atexit
import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path

_FOLDER, _STAGE = "RECORD_STAGES", "RECORD_STAGES_OF"


def _start() -> None:
    folder, top = Path(os.environ[_FOLDER]), str(Path.cwd()) + os.sep
    opened = set()

    def hook(event: str, arguments: tuple) -> None:
        if event == "pipeline.stage":
            begin(arguments)
        elif event == "open" and _STAGE in os.environ and isinstance(arguments[0], str):
            path = os.path.normpath(os.path.join(top, arguments[0]))  # noqa: PTH118  (links are not followed)
            if path.startswith(top):
                opened.add(path[len(top) :])

    def begin(words: Iterable[str]) -> None:
        named = [word for word in words if word.startswith(("pipeline.stages.", "+job."))]
        if named:
            os.environ[_STAGE] = json.dumps(named)  # workers inherit it
        if _STAGE in os.environ:
            atexit.register(write)

    def write() -> None:
        modules = [module for name, module in sys.modules.items() if name.startswith("pipeline")]
        files = {getattr(module, "__file__", None) or "" for module in modules}
        executed = {file.removeprefix(top) for file in files if file}
        executed |= {path for path in opened if path.startswith("pipeline/stages/")}  # -m runs it as __main__
        record = {"stage": json.loads(os.environ[_STAGE]), "executed": sorted(executed), "opened": sorted(opened)}
        record["processor_s"] = time.process_time()
        (folder / f"{os.getpid()}.json").write_text(json.dumps(record), encoding="utf-8")

    sys.addaudithook(hook)
    begin(sys.orig_argv)


if _FOLDER in os.environ:
    _start()
