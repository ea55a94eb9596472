"""Stage `star`: a Siemens star through Sim's lens and sampling, its measured contrast beside the formula."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("star", reads=["scenes"])
def run(run: Run) -> None:
    """Render the star, measure it along both axes, compare with what lens and samples imply."""
    import numpy as np

    from pipeline import store
    from pipeline.camera.characterisation.star import measure
    from pipeline.camera.quantise import to_8bit
    from pipeline.scenes.lens import true_mtf
    from pipeline.scenes.star import render_star, star_geometry

    scenes = run.params.scenes
    size = {"width_px": scenes.width_px, "height_px": scenes.height_px, "periods": scenes.star_periods}
    image = render_star(scenes.samples, **size)
    star = star_geometry(**size)
    centre = (star.centre_px[0] - 0.5, star.centre_px[1] - 0.5)  # from pixel edges to pixel middles
    frequencies = np.asarray(scenes.star_frequencies)
    measured = [
        measure(
            image, centre, star.periods, frequencies, amplitude=star.amplitude, direction=direction, sector_deg=20.0
        )
        for direction in ("horizontal", "vertical")
    ]
    formula = true_mtf(frequencies, scenes.samples)
    error = float(np.abs(np.asarray(measured) - formula).max())
    with store.replacing_folder(run.outputs / "data/star") as folder:
        store.write_arrays(folder / "star.npz", image=to_8bit(image))
        store.write_json(
            folder / "star.json",
            {
                "frequency": 2 * frequencies,  # fractions of Nyquist
                "measured": np.mean(measured, axis=0),
                "measured_horizontal": measured[0],
                "measured_vertical": measured[1],
                "formula": formula[0],
                "largest_error": error,
            },
        )
    metrics = {f"{2 * f:.3f}": value for f, value in zip(frequencies, np.mean(measured, axis=0), strict=True)}
    store.write_json(run.outputs / "reports/metrics/star.json", {"mtf": metrics, "largest_error": error})


if __name__ == "__main__":
    run()
