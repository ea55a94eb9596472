"""The decorator that gives a stage its two ways in.

* ``python -m pipeline.stages.noise --params +job.dataset=sim`` (what ``dvc.yaml`` calls): reads ``params.yaml``,
  writes to the paths DVC tracks.
* ``python -m pipeline.stages.noise key=value ... [--multirun]``: composes ``conf/`` with Hydra, reads inputs from
  the project, and writes below Hydra's output folder, so that a sweep never touches a tracked file.

A stage sees only the sections it declares, which are those under ``params:`` in ``dvc.yaml`` (a test compares), so
it cannot depend on a value whose change would not re-run it.
"""

from __future__ import annotations

import contextlib
import errno
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, cast

from pipeline.errors import InputError, did_you_mean
from pipeline.registry import Registry
from pipeline.signals import handled
from pipeline.store import FULL
from pipeline.weight_files import active_folder

if TYPE_CHECKING:
    from pipeline.config.execution import ExecutorSettings
    from pipeline.config.schema import Config

MODES = Registry(
    "mode",
    "pipeline.config.modes",
    {"params": "pipeline.config.from_params:start", "conf": "pipeline.config.from_conf:start"},
)
"""Ways into a stage, each imported only when it is taken."""


class Params:
    """The declared part of the configuration, by attribute or item; anything else is refused."""

    def __init__(self, stage: str, where: str = "") -> None:
        self._stage, self._where, self._content = stage, where, {}  # type: tuple[str, str, dict[str, Any]]

    def _admit(self, parts: Sequence[str], value: Any) -> None:
        """Make ``value`` reachable under the path ``parts``."""
        head, *rest = parts
        if not rest:
            self._content[head] = value
        else:
            self._content.setdefault(head, Params(self._stage, f"{self._where}{head}."))._admit(rest, value)

    def __getitem__(self, name: str) -> Any:
        content: dict[str, Any] = self.__dict__["_content"]
        if name not in content:
            key = f"{self.__dict__['_where']}{name}"
            raise AttributeError(f"stage '{self._stage}' reads '{key}' without declaring it in reads and dvc.yaml")
        return content[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._content)


@dataclass(frozen=True)
class Run:
    """What a stage is given.

    Attributes:
        params: the declared part of the configuration (`Params`); all else in it is refused.
        job: what distinguishes this stage of a matrix from its siblings, e.g. ``{"dataset": "sim"}``.
        inputs: folder that outputs of earlier stages are relative to: the project, or the root of the profile.
        outputs: folder that output paths are relative to (the same under DVC, Hydra's folder in a sweep).
        released: whether weights trained by this run are the released ones: under DVC, with the profile default.
        project: folder that what belongs to no run is relative to: published tables, records, benchmarks.
        executor: where parallel work runs.
    """

    params: Config
    job: Mapping[str, str]
    inputs: Path
    outputs: Path
    executor: ExecutorSettings
    released: bool = False
    project: Path = Path()

    def map(self, function: Callable[..., Any], items: Sequence[Any], label: str = "") -> list[Any]:
        """`pipeline.executor.run_map` with the configured executor."""
        from pipeline.executor import available_cores, run_map

        workers = self.executor.workers or available_cores()
        backend, address = self.executor.backend, self.executor.address
        return run_map(function, items, workers=workers, backend=backend, address=address, label=label)


@dataclass(frozen=True)
class Stage:
    """A declared stage; calling it runs it from the command line's arguments."""

    name: str
    body: Callable[[Run], None]
    reads: tuple[str, ...]
    job: tuple[str, ...] = field(default=())
    uses: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def sections(self) -> list[str]:
        """Sections of the configuration that this stage reads, the executor's, and the root of its paths."""
        return sorted({path.partition(".")[0] for path in self.reads} | {"executor", "root"})

    def declared(self, job: Mapping[str, str]) -> list[str]:
        """The parameter paths this stage reads for one job, as ``dvc.yaml`` lists them."""
        return [path.format(**job) for path in self.reads]

    def run(
        self,
        config: Any,
        job: Mapping[str, str],
        inputs: Path,
        outputs: Path,
        *,
        released: bool = False,
        weights: Path | None = None,
    ) -> None:
        """Check the job, mask the configuration and call the stage's body.

        Args:
            config: the configuration, or those of its sections that `sections` names.
            job: see `Run`, as for the others.
            inputs: see `Run`.
            outputs: see `Run`.
            released: see `Run`.
            weights: folder that estimators take their weights from; None for the released ones.

        Raises:
            InputError: a job key is missing or unknown, or names nothing configured.
        """
        for key in job:
            if key not in self.job:
                raise InputError(f"job.{key}: stage '{self.name}' does not take it; {did_you_mean(key, self.job)}")
        for key in self.job:
            if key not in job:
                raise InputError(f"stage '{self.name}' needs +job.{key}=NAME")
        params = Params(self.name)
        for path in self.declared(job):
            params._admit(path.split("."), self._find(config, path))
        with active_folder(weights):
            self.body(Run(cast("Config", params), dict(job), inputs, outputs, config.executor, released))

    def _find(self, config: Any, path: str) -> Any:
        value: Any = config
        for part in path.split("."):
            if isinstance(value, Mapping):
                if part not in value:
                    head = path.rsplit(".", 1)[0]
                    hint = did_you_mean(part, value)
                    raise InputError(f"stage '{self.name}': '{part}' is not among the configured {head}; {hint}")
                value = value[part]
            else:
                value = getattr(value, part)
        return value

    def __call__(self, arguments: Sequence[str] | None = None) -> None:
        """Entry point of ``python -m pipeline.stages.NAME``; SIGTERM ends it as Ctrl-C does."""
        arguments = list(sys.argv[1:] if arguments is None else arguments)
        way = "params" if "--params" in arguments else "conf"
        with plain_errors(), handled([signal.SIGTERM], _end):
            MODES.get(way)(self, [argument for argument in arguments if argument != "--params"])


FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
"""Errors of the system where a file or folder may not be read or written."""


@contextlib.contextmanager
def plain_errors() -> Iterator[None]:
    """End the process, after one line instead of a traceback, where a user has to mend something, or on Ctrl-C.

    That is wrong input, a full disk, and a file or folder without permission to read or write.
    """
    try:
        yield
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except OSError as error:
        remedy = "make room" if error.errno in FULL else "give permission" if error.errno in FORBIDDEN else None
        if remedy is None:
            raise
        where = f"{error.filename}: " if error.filename else ""
        print(f"error: {where}{error.strerror}; {remedy} and run again", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise SystemExit(128 + signal.SIGINT) from None


def _end(number: int, frame: FrameType | None) -> None:
    """End as after an error, so that half-written outputs are taken away."""
    raise SystemExit(128 + number)


def stage(
    name: str, *, reads: Sequence[str], job: Sequence[str] = (), uses: Mapping[str, Sequence[str]] | None = None
) -> Callable[[Callable[[Run], None]], Stage]:
    """Declare a stage.

    Args:
        name: as in ``dvc.yaml``.
        reads: parameter paths it may read, exactly those under its ``params:``; ``{dataset}`` and the like are
            filled from the job.
        job: keys that tell the members of a matrix apart.
        uses: registry group -> what it creates of it: parameter paths of sections or names (with a dot), or registry
            names. A registry that is not listed may be used whole. The code dependencies of the stage in ``dvc.yaml``
            follow from it (`pipeline.dependencies`).
    """

    def declare(body: Callable[[Run], None]) -> Stage:
        return Stage(
            name, body, tuple(reads), tuple(job), {group: tuple(paths) for group, paths in (uses or {}).items()}
        )

    return declare
