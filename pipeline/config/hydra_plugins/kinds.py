"""Resolvers of ``conf/``: which of a section's members have a registry name (``kind``), and what a stage watches.

``${names_of_kind:noise.estimators,pca}`` is the list of names whose ``kind`` is ``pca``; with several kinds, of all of
them; ``${names_of_other_kind:...}`` of none of them. ``${dependencies_of_kind:detection.detectors,yolox}`` maps names
to the file that their stage `detector` depends on, ``${dependencies_of_datasets:datasets}`` to those of `index`.
``${dependency_folder:...}`` is a folder, or `NO_DATA` where it is null. ``${sources_of_plug_ins:noise.estimators,
pipeline.noise}`` maps the names whose ``kind`` a third party registers to the SHA-256 of its source and of files that
their options name, or further options by the same names below a third path; ``${files_of_options:noise.estimators}``
maps names to the SHA-256 of such files, as of weights.
`pipeline.config.compose` imports this file; DVC loads it as a Hydra plugin (``hydra.plugins_path`` in ``.dvc/config``),
so it imports nothing of the package but the files beside it.
"""

from __future__ import annotations

import contextlib
from importlib.metadata import entry_points
from importlib.util import find_spec
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf

from .builtin_names import builtin_names
from .named_files import hashes, with_files
from .plug_in_sources import digests

DETECTORS = "pipeline.detection"
"""Entry point group of third parties' detectors."""
NO_DATA = "data/raw/README.md"
"""What a stage of absent data depends on instead: a file that is always there."""


def _members(path: str, kinds: tuple[str, ...], wanted: bool, root: Any) -> dict[str, Any]:
    """Members of a section by name; one that is no section itself has no kind, and the schema refuses it later."""
    section = OmegaConf.select(root, path)
    return {str(name): member for name, member in section.items() if (_value(member, "kind") in kinds) is wanted}


def _value(member: Any, key: str) -> Any:
    return member.get(key) if isinstance(member, DictConfig) else None


def _watched(members: dict[str, Any]) -> DictConfig:
    return OmegaConf.create({name: _dependency(member) for name, member in members.items()})


def _dependency(member: Any) -> str:
    """The file that the stage `detector` depends on: as given, else the weights, else the third party's own module."""
    given = _value(member, "dvc_dependency") or _value(member, "weights")
    return str(given or _plug_in_file(_value(member, "kind")) or NO_DATA)


def _plug_in_file(kind: Any) -> str | None:
    """The source file of a third party's detector, so that a change of it is noticed; None where there is none."""
    if str(kind) in builtin_names(DETECTORS):
        return None
    for point in entry_points(group=DETECTORS, name=str(kind)):
        with contextlib.suppress(Exception):
            module = find_spec(point.module)  # imports the packages above it, which may do anything
            if module is not None and module.has_location:
                return module.origin
    return None


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


def dependencies_of_datasets(path: str, *, _root_: Any) -> DictConfig:
    """Names of datasets, with the data, list of frames and other folder of pictures that `index` depends on."""
    members = OmegaConf.select(_root_, path)
    return OmegaConf.create(
        {
            str(name): {
                "data": dependency_folder(_value(member, "dvc_dependency")),
                "whitelist": dependency_folder(_value(member, "whitelist")),
                "images": dependency_folder(_value(_value(member, "options"), "images")),
            }
            for name, member in members.items()
        }
    )


def sources_of_plug_ins(path: str, group: str, more: str = "", *, _root_: Any) -> DictConfig:
    """Names of the members of a section that are a third party's, with the SHA-256 of its source and option files.

    Args:
        path: of the section, or of a value that is itself a registry name.
        group: entry point group of the registry.
        more: path of further options by the same names, as ``detection.sweep.options`` of datasets; empty for none.
    """
    section = OmegaConf.select(_root_, path)
    further = OmegaConf.select(_root_, more) if more else None
    members = section if isinstance(section, DictConfig) else OmegaConf.create({str(section): {"kind": section}})
    kinds = [
        (str(name), str(_value(member, "kind")), {**_options(member), more: _content(_value(further, str(name)))})
        for name, member in members.items()
    ]
    sources = digests(group, {kind for _, kind, _ in kinds} - builtin_names(group))
    return OmegaConf.create(
        {name: with_files(sources[kind], options) for name, kind, options in kinds if kind in sources}
    )


def files_of_options(path: str, *, _root_: Any) -> DictConfig:
    """Names of a section's members, each with the options that name a file and the file's SHA-256."""
    members = OmegaConf.select(_root_, path)
    return OmegaConf.create({str(name): hashes(_options(member)) for name, member in members.items()})


def _options(member: Any) -> dict[str, Any]:
    return _content(_value(member, "options"))


def _content(options: Any) -> dict[str, Any]:
    content: Any = OmegaConf.to_container(options, resolve=True) if isinstance(options, DictConfig) else {}
    return dict(content)


def dependency_folder(folder: str | None) -> str:
    """What a stage depends on that reads a user's folder."""
    return NO_DATA if folder is None else str(folder)


for resolver in (
    names_of_kind,
    names_of_other_kind,
    dependencies_of_kind,
    dependencies_of_other_kind,
    dependencies_of_datasets,
    dependency_folder,
    files_of_options,
    sources_of_plug_ins,
):
    OmegaConf.register_new_resolver(resolver.__name__, resolver, replace=True)
