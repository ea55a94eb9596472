"""The camera in the loop: policies that choose exposure time and gain, and the loop that judges them.

>>> from pipeline import control
>>> policy = control.create("iopc_continuous", camera=camera, performance=performance)
>>> decision = control.Controller(policy).step(frame, state)      # (H, W) float in [0, 1]; settings it was taken with
>>> driver.apply(decision.state)

`camera` is a `pipeline.control.policy.ControlledCamera`, `performance` a `pipeline.control.performance.Performance`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.registry import Registry

if TYPE_CHECKING:
    from pipeline.control.performance import Performance
    from pipeline.control.policy import ControlledCamera, Policy

__all__ = ["REGISTRY", "Controller", "create"]

REGISTRY = Registry(
    kind="control policy",
    group="pipeline.control",
    builtin={
        "fixed": "pipeline.control.policies.fixed:Fixed",
        "iopc_continuous": "pipeline.control.policies.iopc_continuous:IopcContinuous",
        "iopc_optimal": "pipeline.control.policies.iopc_optimal:IopcOptimal",
        "iopc_target": "pipeline.control.policies.iopc_target:IopcTarget",
        "mean_intensity": "pipeline.control.policies.mean_intensity:MeanIntensity",
        "oracle": "pipeline.control.policies.oracle:Oracle",
        "prosilica": "pipeline.control.policies.prosilica:Prosilica",
        "shim": "pipeline.control.policies.shim:Shim",
        "shin2019": "pipeline.control.policies.shin2019:Shin2019",
    },
    method="decide",
)


def create(
    name: str, camera: ControlledCamera | None = None, performance: Performance | None = None, **options: Any
) -> Policy:
    """A policy by name.

    Args:
        name: one of ``REGISTRY.names()``.
        camera: the camera controlled; None for the default one.
        performance: surface of average precision, for policies that need one.
        options: the policy's own, as in its class.

    Raises:
        InputError: unknown name or option, a missing surface, or a class without `decide`.
    """
    from pipeline.control.policy import ControlledCamera

    known = {"camera": camera or ControlledCamera(), "performance": performance}
    policy: Policy = REGISTRY.create(name, **known, **options)
    return policy


def __getattr__(name: str) -> Any:
    """`Controller` is imported when it is first asked for."""
    if name == "Controller":
        from pipeline.control.controller import Controller

        return Controller
    raise AttributeError(name)
