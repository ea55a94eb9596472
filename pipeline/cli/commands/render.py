"""``camera-monitor render``: frames of the procedural dataset."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.options.given_paths import GivenPath


@click.command("render")
@click.argument("out", type=GivenPath())
@click.option(
    "--number",
    "numbers",
    multiple=True,
    type=click.IntRange(0, 9999),
    default=(0,),
    show_default=True,
    help="viewpoint; repeatable",
)
@click.option(
    "--moment", default=0, show_default=True, type=click.IntRange(0, 3), help="0..3, a tenth of a second apart"
)
@click.option("--samples", default=3, show_default=True, type=click.IntRange(1, 8), help="per pixel and axis")
@click.option("--seed", default=1, show_default=True, help="another seed, another world")
@click.option("--split", default="train", show_default=True, type=click.Choice(["train", "evaluation"]))
def command(out: Path, numbers: tuple[int, ...], moment: int, samples: int, seed: int, split: str) -> None:
    """Render frames with their boxes into the folder OUT."""
    from tqdm import tqdm

    from pipeline.cli.results.refusals import refuse_unwritable
    from pipeline.executor import one_thread
    from pipeline.scenes.dataset import Viewpoint, render
    from pipeline.scenes.files import write

    one_thread()
    refuse_unwritable(out, "OUT")
    for number in tqdm(numbers, delay=2, leave=False):
        write(render(Viewpoint(split, number), moment, seed, samples=samples), out)
    click.echo(f"written to {out}")
