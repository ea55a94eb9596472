"""Stage `generic_lens`: calibrates the spectral blur estimator to a generic lens; a map beside its released weights."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.blur": ["spectral"]}


@stage("generic_lens", reads=["seed", "train.generic_lens"], uses=USES)
def run(run: Run) -> None:
    """Draw pictures, blur them by lenses, calibrate; write the map, and its error before and after."""
    from functools import partial

    import numpy as np

    from pipeline import blur, store
    from pipeline.blur import camera_calibration, generic_lens, spectral
    from pipeline.learning import images

    section, seed = run.params.train.generic_lens, run.params.seed
    weights = run.inputs / "data/weights/mtf_spectral.safetensors"
    draw = partial(images.picture, seed=seed, purpose=generic_lens.PICTURES)
    tiles = run.map(draw, range(section.images), "pictures")
    sharp = generic_lens.sharp_patches(np.stack(tiles), section.patches, section.intrinsic_px, seed)
    # The main network alone: a share of the other one makes this map worse on pictures unlike procedural ones.
    estimator = blur.create("spectral", weights=weights, processed=False)
    fit = camera_calibration.fit_map(estimator, sharp, samples=section.samples, seed=seed, correction=False)
    fit.save(run.outputs / "data/weights" / f"{weights.stem}{spectral.TYPICAL}")
    before, after = fit.error_percent
    values = {"samples": fit.samples, "error_before_percent": before, "error_after_percent": after}
    store.write_json(run.outputs / "reports/metrics/train/generic_lens.json", values)


if __name__ == "__main__":
    run()
