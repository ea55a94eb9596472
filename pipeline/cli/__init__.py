"""``camera-monitor``: the pipeline's tools on your own footage.

Each command is one file in `pipeline.cli.commands`; it is imported when it is called, so that ``--help`` answers at
once. Beside them is what commands share, in folders: ``options`` of the command line, reading of ``frames``, their
``analysis``, writing of ``results``; and what is long of single commands: ``health``, ``watching``, ``calibration``,
``corruption``, ``recording``, ``new_project``.
"""

from __future__ import annotations

import warnings

import click

from pipeline.cli.lazy_group import LazyGroup

COMMANDS = {
    "health": "Estimate blur and noise of pictures or videos together, with intervals and maps.",
    "watch": "Watch a running camera, stream or filling folder: JSON lines and alarms.",
    "calibrate": "Calibrate a camera from sharp pictures or a chart, for --camera NAME.",
    "noise": "Estimate the noise of pictures or videos, over the frame and over time.",
    "corrupt": "Corrupt pictures to a noise level or a blur, with the truth beside them.",
    "dataset": "Check a dataset: what is usable, what would be set aside and why.",
    "render": "Render frames of the procedural dataset Sim.",
    "blur": "Measure blur estimators on recorded pictures: the paper's Table I.",
    "record": "Measure estimators on your frames and photographs, sensors on raw frames.",
    "curves": "Ask measured curves for a detector's average precision at some noise and blur.",
    "advise": "Advise exposure and gain for pictures, and say why.",
    "budget": "Compare the noise of pictures with what their sensor explains, by source.",
    "doctor": "State what is installed, which weights and data are there, what runs.",
    "init": "Make a small project with a dataset, estimator, detector and policy of one's own.",
    "report": "Compare the numbers of two reports.",
    "export": "Export a released network to ONNX.",
    "weights": "List, download and verify published detector weights.",
    "download": "Download and verify published pictures: KITTI, Udacity, real noise, raw frames.",
}


@click.group(
    cls=LazyGroup,
    package="pipeline.cli.commands",
    descriptions=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="camera-condition-pipeline")
def main() -> None:
    """Monitor the physical condition of a camera, on your own pictures."""
    # Pictures of up to twice that size are read, larger ones refused in a line of our own.
    warnings.filterwarnings("ignore", message="Image size .* could be decompression bomb")
