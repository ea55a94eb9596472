"""What a configured detector is: its kind, its options, and the hash of the files that decide what it detects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.detection.settings import DetectorSettings


def detector_identity(name: str, section: DetectorSettings) -> dict[str, Any]:
    """A detector by the files as they are now; another hash is another detector.

    The stage `detector` stores it. Stages that open a detector ask anew: run by themselves, they may open other weights
    than that stage did.

    Args:
        name: of the detector in the configuration.
        section: of it.

    Returns:
        ``kind``; ``weights`` or ``source``, the name of the file, and its ``bytes``; ``options``; ``package_sha256`` of
        a third party's; ``sha256`` of the file and of those that options name.

    Raises:
        InputError: the file is not there, or keeps weights in others that it does not name.
    """
    from pipeline.config.hydra_plugins.named_files import in_one_file, with_files
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.errors import InputError
    from pipeline.experiments.detect import identifying_file
    from pipeline.store import file_sha256

    path = identifying_file(name, section)
    if sentence := in_one_file(f"detection.detectors.{name}.weights", path):
        raise InputError(sentence)
    hashed = "source" if section.weights is None else "weights"
    about = {"kind": section.kind, hashed: path.name, "bytes": path.stat().st_size, "options": section.options}
    source = digest("pipeline.detection", section.kind)
    about |= {} if source is None else {"package_sha256": source}  # of a third party, with its other modules
    return {**about, "sha256": with_files(file_sha256(path), section.options)}
