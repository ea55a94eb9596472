"""What mattered in the training of the blur network: short trainings with one thing changed, and other seeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.report.inputs import existing
from pipeline.report.tables import Column, Table

WORDS = {
    "base": "as released, but short",
    "seed_2": "another seed (2)",
    "seed_3": "another seed (3)",
    "no_noise": "no noise in training",
    "isotropic": "no upright prior (isotropic pictures)",
    "kernel_label": "label without the lens's own blur",
    "few_images": "a tenth of the pictures",
    "few_kernels": "a fifteenth of the kernels",
}
SEEDS = ("base", "seed_2", "seed_3")


def table(folder: Path | None, listed: Sequence[str] = ()) -> Table | None:
    """The table, or None where no variant was run.

    Args:
        folder: one JSON of measures per variant.
        listed: the variants of this run, in their order; without it, every file by name.
    """
    from pipeline import store

    place = existing(folder)
    if place is None:
        return None
    names = list(listed) or sorted(path.stem for path in place.glob("*.json"))
    found = {name: store.read_json(place / f"{name}.json") for name in names if (place / f"{name}.json").is_file()}
    if not found:
        return None
    rows = [
        {
            "variant": WORDS.get(name, name),
            "all": values["mtf_error_percent"],
            "clean": values["mtf_error_clean_percent"],
            "noisy": values["mtf_error_noisy_percent"],
            "sigma": values["sigma_error_dn"],
        }
        for name, values in found.items()
    ]
    columns = [
        Column("variant", "Training"),
        Column("all", "MTF error [%]"),
        Column("clean", "without noise [%]"),
        Column("noisy", "with noise [%]"),
        Column("sigma", "σ error [DN]"),
    ]
    seeds = [found[name]["mtf_error_percent"] for name in SEEDS if name in found]
    notes = ["All are judged on the same held-out samples, those of the released training."]
    if len(seeds) > 1:
        notes.append(f"Seeds alone differ by {max(seeds) - min(seeds):.2f} % in the MTF error: less is no difference.")
    return Table("ablation", "What matters in training the blur network.", columns, rows, notes, "ablation")
