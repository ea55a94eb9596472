"""The configuration of a recording, and the options that every recording on a dataset has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.cli.options.given_paths import GivenPath

if TYPE_CHECKING:
    from pipeline.config.schema import Config

IN_CHECKOUT = "OVERRIDES change conf/: run it in the top folder of a checkout of the repository."
"""Ends the help of commands that compose a configuration, which an installed package has none of."""

overrides_argument = click.argument("overrides", nargs=-1)
dataset_option = click.option("--dataset", required=True, help="name of the dataset, which the overrides add")
to_option = click.option(
    "--to",
    "out",
    required=True,
    type=GivenPath(),
    help="folder to write; only an earlier record in it is replaced",
)
source_option = click.option(
    "--source", required=True, help="where the pictures come from: revision and licence, for the record"
)
keep_option = click.option(
    "--keep",
    type=GivenPath(),
    help="folder in which finished frames are kept, so that an interrupted recording continues: those of other code or "
    "weights are measured anew; delete it after, or when pictures have changed",
)
workers_option = click.option(
    "--workers", default=1, show_default=True, type=click.IntRange(min=1), help="processes; changes no result"
)


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
    from pipeline.cli.results.refusals import refuse_foreign
    from pipeline.config.compose import compose, parse
    from pipeline.config.references import check_references
    from pipeline.errors import InputError, did_you_mean

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
