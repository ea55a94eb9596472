"""Options that every recording on a dataset has."""

from __future__ import annotations

import click

from pipeline.cli.options.given_paths import GivenPath

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
