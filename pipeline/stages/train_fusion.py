"""Stage `train_fusion`: trains the gate that joins the spectral network with GBB and PMP; released weights."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("train_fusion", reads=["train.fusion"])
def run(run: Run) -> None:
    """Draw samples, estimate them by all three, train; write weights and cross-validated errors."""
    from pipeline.blur.fusion import rows as fusion_rows
    from pipeline.blur.fusion import training as fusion_training
    from pipeline.blur.settings import FusionTraining
    from pipeline.learning import training_record
    from pipeline.learning.run_options import RunOptions

    settings: FusionTraining = run.params.train.fusion
    spectral = run.inputs / "data/weights/mtf_spectral.safetensors"
    rows = fusion_rows.rows(settings.recipe, spectral, RunOptions().cache, run.map)
    trained = fusion_training.train(rows, settings)
    fusion_training.save(run.outputs / "data/weights/mtf_fusion.safetensors", trained, settings, released=run.released)
    training_record.write_measures(run.outputs / "reports/metrics/train/mtf_fusion.json", trained.measures)


if __name__ == "__main__":
    run()
