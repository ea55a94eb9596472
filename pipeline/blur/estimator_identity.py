"""Which estimator a calibration was made with, so that no other is corrected by it.

A map of one estimator's errors on another makes answers worse without a sign of it: of shapes alone, that of one
network fits any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

from pipeline.errors import InputError


@runtime_checkable
class HasNetworks(Protocol):
    """An estimator that answers by trained networks."""

    def weights_sha256(self) -> Mapping[str, str]:
        """Name of each network -> SHA-256 of its weights (`pipeline.learning.weights.tensors_sha256`)."""
        ...


@dataclass(frozen=True)
class EstimatorIdentity:
    """An estimator by its class and weights; options beside these are not part of it.

    Attributes:
        estimator: name of its class.
        weights_sha256: see `HasNetworks`; empty without networks.
    """

    estimator: str
    weights_sha256: Mapping[str, str]

    @classmethod
    def of(cls, estimator: Any) -> Self:
        """That of an estimator."""
        networks = estimator.weights_sha256() if isinstance(estimator, HasNetworks) else {}
        return cls(type(estimator).__name__, dict(networks))

    def refuse_other(self, estimator: Any) -> None:
        """Check that an estimator is the one of this identity.

        Raises:
            InputError: it is of another class, or has other networks or weights.
        """
        given = self.of(estimator)
        if given.estimator != self.estimator:
            raise InputError(
                f"calibration of the estimator {self.estimator}, given {given.estimator}; use the one that it was made "
                "with, or calibrate anew"
            )
        differing = sorted(
            name
            for name in {*given.weights_sha256, *self.weights_sha256}
            if given.weights_sha256.get(name) != self.weights_sha256.get(name)
        )
        if differing:
            raise InputError(
                f"calibration of {self.estimator} with other weights or networks ({', '.join(differing)}); use the "
                "weights and options that it was made with, or calibrate anew"
            )

    def content(self) -> dict[str, Any]:
        """It as JSON can hold it."""
        return {"estimator": self.estimator, "weights_sha256": dict(self.weights_sha256)}

    @classmethod
    def from_content(cls, content: Any) -> Self:
        """What `content` gave.

        Raises:
            KeyError, TypeError, ValueError: not such a content.
        """
        estimator, networks = content["estimator"], dict(content["weights_sha256"])
        if not all(isinstance(word, str) for word in (estimator, *networks, *networks.values())):
            raise ValueError("made_for: expected the name of an estimator and SHA-256 of its networks by name")
        return cls(estimator, networks)
