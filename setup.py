"""Build step: a wheel carries the released weights, which lie outside the package in a checkout."""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

WEIGHTS = Path(__file__).resolve().parent / "data" / "weights"
SUFFIXES = (".safetensors", ".json")


class BuildWithWeights(build_py):
    """Copies ``data/weights`` to ``pipeline/released_weights`` of a build; an editable install uses the checkout's."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        target = Path(self.build_lib) / "pipeline" / "released_weights"
        target.mkdir(parents=True, exist_ok=True)
        for file in sorted(WEIGHTS.iterdir()):
            if file.suffix in SUFFIXES:
                shutil.copyfile(file, target / file.name)


setup(cmdclass={"build_py": BuildWithWeights})
