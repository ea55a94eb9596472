"""Developing one frame in the simulated camera: each step and whole cameras, beside kornia and OpenCV, one thread.

    python benchmarks/camera_pipeline.py [--out FILE] [--repeats N] [--note TEXT]

Two comparisons on one 1242 x 376 colour frame:

* ``steps``: demosaicing, bilateral filter, unsharp mask and JPEG alone, beside kornia's on a tensor of the same values.
  ``difference_dn`` is the mean absolute difference of the results in DN, away from the border: who differs in what is
  computed shows there (kornia's JPEG is a differentiable model of the codec, ours the codec).
* ``cameras``: a shot through each named camera (`pipeline.camera.processing.presets`) from linear light to the stored
  picture; and a chain of the same steps as the plain one of them (bilinear demosaicing, white balance, matrix, tone
  curve, bilateral filter, unsharp mask, JPEG) in kornia, with the same raw noise.

Times are least and median of the turns, on the clock and of the processor. Ratios are peer over ours by least processor
time; below 1 we lose.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline.camera import tone_curve  # noqa: E402
from pipeline.camera.processing import colour, demosaic, presets, sharpen, white_balance  # noqa: E402
from pipeline.camera.processing.codec import Codec, jpeg, store  # noqa: E402
from pipeline.camera.processing.denoise import Denoising, denoise_luma  # noqa: E402
from pipeline.camera.processing.develop import CameraPipeline  # noqa: E402
from pipeline.camera.processing.raw_noise import RawNoise  # noqa: E402
from pipeline.streams import stream  # noqa: E402

SHAPE = (376, 1242)
ISO = 1600.0
QUALITY = 90
SIGMA = 0.03
BORDER = 16
BILATERAL = {"size_px": 5, "value": 0.09, "space_px": 2.2}
SHARPENING = sharpen.Sharpening(0.6, 1.0)


def scene() -> np.ndarray:
    """Smooth colours with edges in linear light: (376, 1242, 3) float32 in [0, 1]."""
    import cv2

    draws = stream(0, "camera pipeline benchmark")
    coarse = draws.random((24, 78, 3), dtype=np.float32)
    smooth = cv2.resize(coarse, SHAPE[::-1], interpolation=cv2.INTER_CUBIC)
    blocks = cv2.resize(draws.random((12, 39, 3), dtype=np.float32), SHAPE[::-1], interpolation=cv2.INTER_NEAREST)
    return np.clip(0.05 + 0.5 * smooth * blocks, 0, 1).astype(np.float32)


def plain_camera() -> CameraPipeline:
    """The camera that kornia's operations can follow step by step."""
    return CameraPipeline(
        noise=RawNoise.at_iso(ISO, full_well_e=10_000, read_e=3.0),
        balance=(1.9, 1.7),
        demosaicing="bilinear",
        colour_diagonal=(1.6, 1.5, 1.5),
        denoising=Denoising("bilateral", strength=1.0),
        sharpening=SHARPENING,
        codec=Codec("jpeg", QUALITY),
    )


def steps(light: np.ndarray) -> dict[str, dict[str, Callable[[], np.ndarray]]]:
    """Step -> contestant -> call that gives a picture, fraction of white."""
    import kornia
    import torch

    camera = plain_camera()
    raw = camera.noise.add(camera.expose(light), stream(1, "camera pipeline benchmark"))
    raw = np.clip(white_balance.balance(raw, *camera.balance), 0, 1)
    linear = colour.apply(demosaic.demosaic(raw, "bilinear"), camera.colour_matrix)
    encoded = tone_curve.render(linear, camera.gamma, camera.s_curve)
    luma = np.ascontiguousarray(colour.to_luma_chroma(encoded)[..., 0])
    picture = np.clip(np.rint(encoded * 255), 0, 255).astype(np.uint8)
    raw_tensor, luma_tensor = torch.from_numpy(raw)[None, None], torch.from_numpy(luma)[None, None]
    picture_tensor = torch.from_numpy(np.ascontiguousarray(picture.transpose(2, 0, 1))).float()[None] / 255
    quality = torch.tensor([float(QUALITY)])
    ours = Denoising("bilateral", strength=BILATERAL["value"] / SIGMA / 1.5, radius_px=BILATERAL["space_px"] - 1.2)
    space = (BILATERAL["space_px"],) * 2

    def planes(tensor: Any) -> np.ndarray:
        return tensor[0].numpy().transpose(1, 2, 0)

    return {
        "demosaicing, bilinear": {
            "ours": lambda: demosaic.demosaic(raw, "bilinear"),
            "kornia.color.raw_to_rgb": lambda: planes(kornia.color.raw_to_rgb(raw_tensor, kornia.color.CFA.BG)),
        },
        "bilateral filter of luma, 5 px": {
            "ours": lambda: denoise_luma(luma, ours, SIGMA),
            "kornia.filters.bilateral_blur": lambda: planes(
                kornia.filters.bilateral_blur(luma_tensor, 5, BILATERAL["value"], space)
            )[..., 0],
        },
        "unsharp mask of luma": {
            "ours": lambda: sharpen.sharpen(luma, SHARPENING, SIGMA),
            "kornia.filters.unsharp_mask": lambda: planes(_unsharp(kornia, luma_tensor))[..., 0],
        },
        f"JPEG, quality {QUALITY}": {
            "ours": lambda: jpeg(picture, QUALITY) / np.float32(255),
            "kornia.enhance.jpeg_codec_differentiable": lambda: planes(
                kornia.enhance.jpeg_codec_differentiable(picture_tensor, quality)
            ),
        },
    }


def _unsharp(kornia: Any, luma: Any) -> Any:
    """Kornia's unsharp mask adds the whole detail; ours a part of it, so that the amount is applied here."""
    radius = SHARPENING.radius_px
    return luma + SHARPENING.amount * (kornia.filters.unsharp_mask(luma, (9, 9), (radius, radius)) - luma)


def cameras(light: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    """Whole cameras: name -> call that gives the stored picture, uint8."""
    draws = stream(2, "camera pipeline benchmark")
    calls: dict[str, Callable[[], np.ndarray]] = {"ours, plain": partial(plain_camera().shoot, light, draws)}
    calls["kornia, plain"] = partial(kornia_camera, light, draws)
    for name, preset in presets.PRESETS.items():
        calls[f"ours, {name}"] = partial(preset.at_iso(ISO).shoot, light, draws)
    return calls


def kornia_camera(light: np.ndarray, draws: np.random.Generator) -> np.ndarray:
    """The plain camera with kornia's operations on tensors; raw noise and codec are ours."""
    import kornia
    import torch

    camera = plain_camera()
    noisy = camera.noise.add(camera.expose(light), draws)
    tensor = torch.from_numpy(np.clip(white_balance.balance(noisy, *camera.balance), 0, 1))[None, None]
    matrix = torch.from_numpy(np.asarray(camera.colour_matrix))
    rgb = torch.einsum("ij,njhw->nihw", matrix, kornia.color.raw_to_rgb(tensor, kornia.color.CFA.BG))
    encoded = rgb.clamp(0, 1) ** (1 / camera.gamma)
    planes = kornia.color.rgb_to_ycbcr(encoded)
    luma = kornia.filters.bilateral_blur(planes[:, :1], 5, BILATERAL["value"], (BILATERAL["space_px"],) * 2)
    whole = kornia.color.ycbcr_to_rgb(torch.cat([_unsharp(kornia, luma), planes[:, 1:]], dim=1))
    picture = (whole[0] * 255).round_().clamp_(0, 255).byte().numpy().transpose(1, 2, 0)
    return store(np.ascontiguousarray(picture), camera.codec)


def difference_dn(first: np.ndarray, second: np.ndarray) -> float:
    """Mean absolute difference away from the border, DN."""
    inner = (slice(BORDER, -BORDER), slice(BORDER, -BORDER))
    return round(float(np.abs(first[inner].astype(np.float64) - second[inner]).mean() * 255), 3)


def main(arguments: list[str] | None = None) -> int:
    """Run both comparisons and write their record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file; benchmarks/results/camera_pipeline.json by default")
    parser.add_argument("--repeats", type=int, default=9, help="turns")
    parser.add_argument("--note", default="", help="what else ran on the machine, for the record")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    import torch

    light = scene()
    record: dict[str, Any] = {
        "frame_px": list(SHAPE), "iso": ISO, "note": options.note, "steps": {},
        "machine": common.machine("torch", "kornia", "opencv-python-headless", "av"),
    }  # fmt: skip
    with torch.inference_mode():
        for step, contestants in steps(light).items():
            results = {name: call() for name, call in contestants.items()}
            times = common.take_turns(contestants, options.repeats)
            peer = next(name for name in contestants if name != "ours")
            times[peer]["difference_dn"] = difference_dn(results["ours"], results[peer])
            times[peer]["times_ours"] = _ratio(times[peer], times["ours"])
            record["steps"][step] = times
        times = common.take_turns(cameras(light), options.repeats)
    times["kornia, plain"]["times_ours"] = _ratio(times["kornia, plain"], times["ours, plain"])
    record["cameras"] = times
    for name, row in [(name, row) for part in (*record["steps"].values(), times) for name, row in part.items()]:
        print(
            f"{name:42} {row['processor_least_ms']:8.1f} ms", *(f"{key} {row[key]}" for key in row if "_ms" not in key)
        )
    print(common.write("camera_pipeline", record, options.out))
    return 0


def _ratio(peer: dict[str, float], ours: dict[str, float]) -> float:
    return round(peer["processor_least_ms"] / ours["processor_least_ms"], 2)


if __name__ == "__main__":
    raise SystemExit(main())
