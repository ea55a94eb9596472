"""Estimators and detectors by registry name, which ``dvc.yaml`` expands into stages with that name's dependencies.

Registry -> kind -> names of that kind (of detectors, name -> file that the stage `detector` depends on). Derived from
the sections `noise`, `blur` and `detection`, not set by hand; ``other`` holds what third parties registered.
"""

from __future__ import annotations

from pipeline.config.schema_base import Name

SECTION = dict[Name, dict[Name, list[Name] | dict[Name, str]]]
