"""The configuration of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.results.refusals import refuse_foreign
from pipeline.config.compose import compose, parse
from pipeline.config.references import check_references
from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pipeline.config.schema import Config


def recording_config(
    overrides: Sequence[str],
    out: Path,
    dataset: str,
    results: Sequence[str],
    keep: Path | None = None,
    *,
    estimators: Sequence[str] = (),
    detector: str | None = None,
) -> Config:
    """The configuration of a recording, which has the names that the command line gives.

    Args:
        overrides: of ``conf/``.
        out: folder to write; replaced, so nothing but an earlier record may be in it.
        dataset: a name in ``datasets``.
        results: patterns of the files of a record, see `pipeline.cli.results.refusals.refuse_foreign`.
        keep: folder of finished frames, or None.
        estimators: names in ``blur.estimators``.
        detector: a name in ``detection.detectors``, or None.

    Raises:
        InputError: the folder cannot be written or holds something else, an override is wrong, or a name is not in
            the configuration.
    """
    config = parse(compose(overrides), "conf/")
    check_references(config)
    for option, names, known in (
        ("dataset", [dataset], list(config.datasets)),
        ("estimator", estimators, list(config.blur.estimators)),
        ("detector", [] if detector is None else [detector], list(config.detection.detectors)),
    ):
        for name in names:
            if name not in known:
                raise InputError(f"--{option} {name}: not in the configuration; {did_you_mean(name, known)}")
    section = config.datasets[dataset]
    read = [section.root, section.whitelist, config.psf.folder, keep]
    if detector is not None:
        read.append(config.detection.detectors[detector].weights)
    refuse_foreign(out, "--to", results, [Path(name) for name in read if name])
    return config
