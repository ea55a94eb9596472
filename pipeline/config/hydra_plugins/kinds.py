"""Resolvers of ``conf/``: which of a section's members have a registry name (``kind``), and what a stage watches.

``${names_of_kind:noise.estimators,pca}`` is the list of names whose ``kind`` is ``pca``; with several kinds, of all of
them; ``${names_of_other_kind:...}`` of none of them. ``${dependencies_of_kind:detection.detectors,yolox}`` maps names
to their ``dvc_dependency``. ``${dependency_folder:...}`` is a folder, or `NO_DATA` where it is null.
`pipeline.config.compose` imports
this file; DVC loads it as a Hydra plugin (``hydra.plugins_path`` in ``.dvc/config``), so it imports nothing of the
package.
"""

from __future__ import annotations

from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf

NO_DATA = "data/raw/README.md"
"""What a stage of absent data depends on instead: a file that is always there."""


def _members(path: str, kinds: tuple[str, ...], wanted: bool, root: Any) -> dict[str, Any]:
    section = OmegaConf.select(root, path)
    return {str(name): member for name, member in section.items() if (member["kind"] in kinds) is wanted}


def _watched(members: dict[str, Any]) -> DictConfig:
    return OmegaConf.create({name: str(member["dvc_dependency"]) for name, member in members.items()})


def names_of_kind(path: str, *kinds: str, _root_: Any) -> ListConfig:
    """Names of the members of a section that are of some kinds."""
    return OmegaConf.create(list(_members(path, kinds, True, _root_)))


def names_of_other_kind(path: str, *kinds: str, _root_: Any) -> ListConfig:
    """Names of the members of a section that are of no such kind."""
    return OmegaConf.create(list(_members(path, kinds, False, _root_)))


def dependencies_of_kind(path: str, *kinds: str, _root_: Any) -> DictConfig:
    """Names of the members of a section that are of some kinds, with the file each depends on."""
    return _watched(_members(path, kinds, True, _root_))


def dependencies_of_other_kind(path: str, *kinds: str, _root_: Any) -> DictConfig:
    """Names of the members of a section that are of no such kind, with the file each depends on."""
    return _watched(_members(path, kinds, False, _root_))


def dependency_folder(folder: str | None) -> str:
    """What a stage depends on that reads a user's folder."""
    return NO_DATA if folder is None else str(folder)


for resolver in (
    names_of_kind,
    names_of_other_kind,
    dependencies_of_kind,
    dependencies_of_other_kind,
    dependency_folder,
):
    OmegaConf.register_new_resolver(resolver.__name__, resolver, replace=True)
