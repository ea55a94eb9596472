"""Links to folders below what stages depend on, behind which DVC sees no edit, are refused; other links are taken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import composed
import pytest
from data_makers import make_folder, make_kitti, make_udacity

from pipeline.config.schema import Config
from pipeline.errors import InputError
from pipeline.linked_folders import refuse_linked_folders
from pipeline.stages import index, psf_bank, real_noise

ROOT = Path(__file__).resolve().parents[1]


def configured(*overrides: str) -> Config:
    return composed.config("profile=smoke", "executor.workers=1", *overrides)


def behind_link(folder: Path) -> Path:
    """The same folder moved elsewhere, with a link in its place."""
    real = folder.parent / f"real-{folder.name}"
    folder.rename(real)
    folder.symlink_to(real)
    return folder


def indexed(out: Path, kind: str, root: Path, *more: str) -> list[str]:
    config = configured(f"+dataset@datasets.mine={kind}", f'datasets.mine.root="{root}"', *more)
    index.run.run(config, {"dataset": "mine"}, out, out)
    return sorted(path.name for path in (out / "data/index/mine").iterdir())


@pytest.mark.parametrize(
    ("kind", "make", "linked"),
    [("folder", make_folder, "labels"), ("folder", make_folder, "images"), ("kitti", make_kitti, "training/label_2")],
)
def test_the_index_refuses_a_linked_folder_of_a_dataset(
    kind: str, make: Callable[..., Path], linked: str, tmp_path: Path
) -> None:
    root = make(tmp_path / "of mine", frames=1)
    link = behind_link(root / linked)
    with pytest.raises(InputError) as caught:
        indexed(tmp_path / "out", kind, root)
    message = str(caught.value)
    assert f"datasets.mine.root={root}: {link} is a link to a folder" in message and "\n" not in message
    assert f"(rm '{link}'; cp -rs '{link.resolve()}' '{link}')" in message and not (tmp_path / "out/data").exists()


def test_links_that_dvc_follows_are_taken(tmp_path: Path) -> None:
    """The dataset's folder itself, and single files, as the message advises."""
    root = make_folder(tmp_path / "mine", frames=1)
    behind_link(root)
    file = root / "labels/frame-0.txt"
    (tmp_path / "elsewhere.txt").write_text(file.read_text())
    file.unlink()
    file.symlink_to(tmp_path / "elsewhere.txt")
    assert "frames.parquet" in indexed(tmp_path / "out", "folder", root)


def test_a_folder_of_pictures_beside_the_labels_has_no_linked_folder_either(tmp_path: Path) -> None:
    root = make_udacity(tmp_path / "drives", frames=2, layout="autti")
    images = tmp_path / "pictures"
    (root / "object-dataset").rename(images)
    (root / "object-dataset").mkdir()
    (images / "labels.csv").rename(root / "object-dataset/labels.csv")
    given = f'+datasets.mine.options.images="{behind_link(images)}"'
    assert "frames.parquet" in indexed(tmp_path / "out", "udacity", root, given)
    (images / "more").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"datasets\.mine\.options\.images=.*more is a link to a folder"):
        indexed(tmp_path / "out", "udacity", root, given)


def test_recordings_and_kernels_are_looked_at_too(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    folder = tmp_path / "given"
    folder.mkdir()
    (folder / "below").symlink_to(tmp_path / "real")
    config = configured(f'real_noise.recordings.cc.folder="{folder}"', "psf=paper", f'psf.folder="{folder}"')
    for stage, job, setting in ((real_noise, {"recording": "cc"}, "real_noise.recordings.cc"), (psf_bank, {}, "psf")):
        with pytest.raises(InputError, match=rf"{setting}\.folder=.*below is a link to a folder"):
            stage.run.run(config, job, tmp_path, tmp_path)


def test_what_is_absent_or_not_given_is_passed(tmp_path: Path) -> None:
    refuse_linked_folders(None, "a")
    refuse_linked_folders(tmp_path / "absent", "a")
