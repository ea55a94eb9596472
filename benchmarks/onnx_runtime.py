"""Time per patch of the released networks in ONNX Runtime, beside PyTorch, whose outputs they equal.

Usage::

    python benchmarks/onnx_runtime.py [--out FILE] [--repeats N]

One thread each, on the same features, for one patch and for a batch of 16; the two take turns. ``ratio`` is PyTorch's
least time over ONNX Runtime's: above 1 ONNX Runtime is faster. ``features_ms`` is what precedes the network in both.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

BATCHES = (1, 16)


def measured(repeats: int) -> dict[str, object]:
    """Network -> batch -> least and median time of both runtimes, ms per patch, and their ratio."""
    import torch

    from pipeline.cli.onnx_networks import NETWORKS, example_patches, export, session

    rows: dict[str, object] = {}
    for name, network in NETWORKS.items():
        model = network.load().eval()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "network.onnx"
            difference = export(name, path).difference
            runtime = session(path)
            by_batch = {}
            for batch in BATCHES:
                patches = example_patches(batch, network.side_px)
                inputs = network.features(patches)
                arrays = {key: value.numpy() for key, value in inputs.items()}
                with torch.inference_mode():
                    times = common.take_turns(
                        {
                            "torch": partial(model, *inputs.values()),
                            "onnxruntime": partial(runtime.run, None, arrays),
                            "features": partial(network.features, patches),
                        },
                        repeats,
                    )
                least = {key: value["processor_least_ms"] / batch for key, value in times.items()}
                by_batch[str(batch)] = {
                    "torch_ms": round(least["torch"], 4),
                    "onnxruntime_ms": round(least["onnxruntime"], 4),
                    "features_ms": round(least["features"], 4),
                    "ratio": round(least["torch"] / least["onnxruntime"], 2),
                }
        rows[name] = {"largest_difference": difference, "batches": by_batch}
    return rows


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--repeats", type=common.positive, default=15)
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    rows = measured(arguments.repeats)
    print(f"{'network':24} {'batch':>5} {'torch ms':>9} {'ONNX Runtime ms':>16} {'features ms':>12} {'ratio':>6}")
    for name, row in rows.items():
        for batch, times in row["batches"].items():  # type: ignore[index]
            print(
                f"{name:24} {batch:>5} {times['torch_ms']:9.3f} {times['onnxruntime_ms']:16.3f}"
                f" {times['features_ms']:12.3f} {times['ratio']:6.2f}"
            )
    machine = common.machine("torch", "onnx", "onnxruntime")
    path = common.write(
        "onnx_runtime", {"machine": machine, "repeats": arguments.repeats, "networks": rows}, arguments.out
    )
    print(f"written to {path}")


if __name__ == "__main__":
    common.run(main)
