"""Compares what stage processes executed and opened with the dependencies that ``dvc.yaml`` declares for them.

``python tests/recorder/compare.py FOLDER`` in the project's top folder prints each difference and exits with 1 if there
is one; `make smoke` calls it. It also prints which stages took most of the processors' time.
"""

import json
import sys
from collections import Counter
from pathlib import Path

from pipeline import yaml_text
from pipeline.dependencies import stage_groups

FREE = ("params.yaml", "dvc.yaml", "dvc.lock", ".cache/", ".git", "conf/", ".dvc", "tests/recorder/")
"""Opened by machinery (parameters are dependencies by value) or caches with a fingerprint in their name."""
STARTS = ("pipeline/dvc/", "pipeline/freed_memory.py")
"""Start stages, in whose processes they remain; of a stage that imports one itself, `pipeline.dependencies` knows."""
BY_HASH = {"data/index/": "data/sim/", "data/detector/": "data/weights/"}
"""A folder whose content hashes are in a dependency -> files that may be opened."""


def _dotted(params, prefix=""):
    """Parameters by dotted name."""
    flat = {}
    for key, value in params.items():
        flat |= _dotted(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return flat


def declared(group, item, params):
    """Dependencies and outputs of one member of a group, as paths."""
    body, values = group.body, {**_dotted(params), **item}
    outs = [
        next(iter(out)) if isinstance(out, dict) else out for key in ("outs", "metrics") for out in body.get(key, [])
    ]
    return {stage_groups.filled(line, values) for line in [*body["deps"], *outs]}


def records(folder):
    """What `sitecustomize` wrote of each process."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(Path(folder).glob("*.json"))]


def problems(recorded, top=Path()):
    """Differences of all records, one line each."""
    params = yaml_text.parse((top / "params.yaml").read_text(encoding="utf-8"))
    groups = stage_groups.groups(yaml_text.parse((top / "dvc.yaml").read_text(encoding="utf-8")), params)
    results = set()
    for record in recorded:
        module, *words = record["stage"]
        job = dict(word.removeprefix("+job.").split("=", 1) for word in words)
        members = [(g, item) for g in groups for item, of in zip(g.items, g.jobs(), strict=False)
                   if g.module == module and of == job]  # fmt: skip
        if not members:
            results.add(f"{module} {job}: no stage of dvc.yaml")
            continue
        group, item = members[0]
        paths = declared(group, item, params)
        root = params["root"]
        free = (*FREE, f"{root}.cache/", *(f"{root}{opened}" for given, opened in BY_HASH.items()
                         if any(line.startswith(f"{root}{given}") for line in paths)))  # fmt: skip

        def inside(file, paths=paths):
            return any(file == line or file.startswith(f"{line.rstrip('/')}/") for line in paths)

        for file in record["executed"]:
            of_stage = file.startswith("pipeline/") and file.endswith(".py") and not file.startswith(STARTS)
            if of_stage and not inside(file):
                results.add(f"{group.name}: executes {file}, which is not in deps")
        for file in record["opened"]:
            compiled = file.endswith((".pyc", ".py")) or "__pycache__" in file or "/.writing-" in file
            if not compiled and not file.startswith(free) and not inside(file) and Path(top, file).is_file():
                results.add(f"{group.name}: opens {file}, which is not in deps or outs")
    return sorted(results)


def costliest(recorded, most=12):
    """Stages by the processor time of all their processes, one line each, with their share of the whole."""
    spent = Counter()
    for record in recorded:
        module, *words = record["stage"]
        members = (word.partition("=")[2] for word in words)
        spent[" ".join([module.removeprefix("pipeline.stages."), *members])] += record["processor_s"]
    total = sum(spent.values())
    return [f"{total:6.0f} s of processor time, of which"] + [
        f"{seconds:6.0f} s  {seconds / total:4.0%}  {stage}" for stage, seconds in spent.most_common(most)
    ]


if __name__ == "__main__":
    recorded = records(sys.argv[1])
    print("\n".join(costliest(recorded)))
    lines = problems(recorded)
    print("\n".join(lines) or "every module executed and file opened is a declared dependency")
    raise SystemExit(1 if lines else 0)
