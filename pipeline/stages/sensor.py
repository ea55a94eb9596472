"""Stage `sensor`: the sensor's constants, moments and photon-transfer curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("sensor", reads=["seed", "camera"])
def run(run: Run) -> None:
    """Measure the sensor by drawing from it; write the numbers and the metrics."""
    from pipeline import store
    from pipeline.camera.characterisation.moments import moments, simulated_transfer, transfer_rows

    sensor = run.params.camera.sensor
    result = moments(sensor, run.params.seed)
    curve = transfer_rows(simulated_transfer(sensor, run.params.seed), sensor)
    with store.replacing_folder(run.outputs / "data/sensor") as folder:
        store.write_json(folder / "formation.json", result)
        store.write_json(folder / "photon_transfer.json", curve)
    store.write_json(run.outputs / "reports/metrics/sensor.json", result)


if __name__ == "__main__":
    run()
