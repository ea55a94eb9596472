"""``camera-monitor export``: a released network as an ONNX file, compared with the original before it is written."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.options.given_paths import GivenPath


@click.command("export")
@click.argument("network")
@click.option("--out", required=True, type=GivenPath(dir_okay=False), help="file to write, NAME.onnx")
def command(network: str, out: Path) -> None:
    """Export NETWORK, one of the released ones, to ONNX, for programs without PyTorch.

    Prints inputs and outputs, the SHA-256 of the weights and how far the outputs of ONNX Runtime are from those of
    PyTorch; a file whose outputs differ is not written, and one that is there is not replaced. Needs the extra onnx.
    """
    from pipeline.cli.onnx_networks import export
    from pipeline.cli.results.refusals import refuse_foreign_file, refuse_unwritable

    refuse_foreign_file(out, "--out")
    refuse_unwritable(out.parent, "--out")
    exported = export(network, out)
    for kind, shapes in (("input", exported.inputs), ("output", exported.outputs)):
        for name, shape in shapes.items():
            click.echo(f"{kind:6} {name:14} {' x '.join(map(str, shape))}")
    click.echo(f"weights {network}.safetensors, SHA-256 {exported.weights_sha256}")
    click.echo(f"largest difference from PyTorch {exported.difference:.1e} of an output's largest value")
    click.echo(f"written to {out}: {exported.description}")
