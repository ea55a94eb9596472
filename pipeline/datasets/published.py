"""Published pictures and kernels that this project measures on: where they lie, and what their bytes hash to.

`get` brings one of `TABLE` into a folder in the layout that its reader expects (`pipeline.downloads` fetches and
verifies the files; archives are unpacked). Nothing here is part of a run. Sources of the hashes:

- ``kitti``: the checksums that TensorFlow Datasets records for the two archives.
- ``udacity``: none is published; the first download is trusted and its hash recorded.
- the others (``published_files.csv``): the copies that the records in ``reports/recorded`` were measured on; a file
  that hashes to something else is another picture, and is refused.
"""

from __future__ import annotations

import csv
import shutil
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO
from urllib.parse import quote

from pipeline import downloads
from pipeline.downloads import PublishedFile
from pipeline.errors import InputError, printable
from pipeline.store import replacing_folder

FILES = Path(__file__).with_name("published_files.csv")
Progress = Callable[[str, int, int | None], None]
_RAW = "https://raw.githubusercontent.com"
_KITTI = "https://s3.eu-central-1.amazonaws.com/avg-kitti"
_UDACITY = "https://s3.amazonaws.com/udacity-sdc/annotations"
_KERNELS = f"{_RAW}/MaikWischow/Camera-Condition-Monitoring"


@dataclass(frozen=True)
class Archive:
    """An archive of which a folder is unpacked.

    Attributes:
        file: the archive.
        folder: of it, with all that it holds; nothing else is unpacked.
    """

    file: PublishedFile
    folder: str


@dataclass(frozen=True, kw_only=True)
class PublishedData:
    """Published pictures or kernels.

    Attributes:
        holds: what they are, in a few words.
        licence: as their authors state it.
        next_step: a command that uses them, where FOLDER stands for theirs.
        archives: to download and unpack.
        bases: addresses that the single files of `FILES` lie below, the first that has one is taken.
    """

    holds: str
    licence: str
    next_step: str
    archives: tuple[Archive, ...] = ()
    bases: tuple[str, ...] = ()


TABLE: dict[str, PublishedData] = {
    "kitti": PublishedData(
        holds="7,481 street frames with labels (object detection, left camera, without preceding frames)",
        licence="CC BY-NC-SA 3.0",
        next_step="dvc exp run -S +dataset@datasets.kitti=kitti -S datasets.kitti.root=FOLDER",
        archives=(
            Archive(
                PublishedFile(
                    file="data_object_label_2.zip",
                    urls=(f"{_KITTI}/data_object_label_2.zip",),
                    size_bytes=5_601_213,
                    sha256="4efc76220d867e1c31bb980bbf8cbc02599f02a9cb4350effa98dbb04aaed880",
                ),
                "training/label_2",
            ),
            Archive(
                PublishedFile(
                    file="data_object_image_2.zip",
                    urls=(f"{_KITTI}/data_object_image_2.zip",),
                    size_bytes=12_569_945_557,
                    sha256="351c5a2aa0cd9238b50174a3a62b846bc5855da256b82a196431d60ff8d43617",
                ),
                "training/image_2",
            ),
        ),
    ),
    "udacity": PublishedData(
        holds="street frames with labels, by Autti and by CrowdAI",
        licence="MIT",
        next_step="dvc exp run -S +dataset@datasets.udacity=udacity -S datasets.udacity.root=FOLDER",
        archives=tuple(
            Archive(PublishedFile(file=f"{name}.tar.gz", urls=(f"{_UDACITY}/{name}.tar.gz",)), name)
            for name in ("object-dataset", "object-detection-crowdai")
        ),
    ),
    "paper_kernels": PublishedData(
        holds="the paper's 50 blur kernels",
        licence="MIT",
        next_step="dvc exp run -S psf=paper -S psf.folder=FOLDER",
        bases=(
            f"{_KERNELS}/f5739863748c559a20d842d9be13ba84cd703180/data/kernels",
            f"{_KERNELS}/afe3f145cc652a786d34fce6b633d5db25242f1a/data/kernels",
        ),
    ),
    "cc": PublishedData(
        holds="8 photographs of real noise, each with the mean of 500 shots (Nam et al. 2016)",
        licence="HKPolyU, non-commercial",
        next_step="dvc exp run -S real_noise.recordings.cc.folder=FOLDER real_noise@cc report",
        bases=(f"{_RAW}/csjunxu/MCWNNM-ICCV2017/aa344066ea9cfbe66f27c921cabfafd9ec6e127d/Real_ccnoise_denoised_part",),
    ),
    "polyu": PublishedData(
        holds="50 photographs of real noise, each with the mean of many shots (Xu et al. 2018)",
        licence="HKPolyU, non-commercial",
        next_step="dvc exp run -S real_noise.recordings.polyu.folder=FOLDER real_noise@polyu report",
        bases=(
            f"{_RAW}/csjunxu/PolyU-Real-World-Noisy-Images-Dataset/488d733181fb71ce8ef58c1869f70aa21b33d535"
            "/CroppedImages",
        ),
    ),
    "flea3": PublishedData(
        holds="63 raw frames of a machine-vision camera, lit and dark, at seven exposures (Llanos 2019)",
        licence="Boost",
        next_step="dvc exp run -S real_noise.recordings.flea3.folder=FOLDER real_noise@flea3 report",
        bases=(f"{_RAW}/bllanos/chromatic-aberration/9b052aff7155b2964db98bbfa6a9b5a5cc24f3c5/demo_data",),
    ),
}
"""By name."""


@dataclass(frozen=True)
class Brought:
    """What `get` did.

    Attributes:
        files: there now, verified or unpacked from what was verified.
        downloaded: of the single files and archives, those that were not there before.
        kept: folders of archives that were there before and were left as they are, unverified.
        first_use: archives whose hash nothing was there to compare with.
    """

    files: int
    downloaded: int
    kept: tuple[Path, ...]
    first_use: tuple[str, ...]


def single_files(name: str) -> list[PublishedFile]:
    """The single files of an entry of `TABLE`; none where it is in archives."""
    with FILES.open(encoding="utf-8", newline="") as stream:
        return [
            PublishedFile(
                file=row["path"],
                urls=tuple(f"{base}/{quote(row['path'])}" for base in TABLE[name].bases),
                size_bytes=int(row["size_bytes"]),
                sha256=row["sha256"],
            )
            for row in csv.DictReader(stream)
            if row["data"] == name
        ]


def size_bytes(name: str) -> int | None:
    """Bytes to download for an entry of `TABLE`; None where they are not published."""
    files = single_files(name) + [archive.file for archive in TABLE[name].archives]
    sizes = [file.size_bytes for file in files if file.size_bytes is not None]
    return sum(sizes) if len(sizes) == len(files) else None


def is_there(name: str, folder: Path) -> bool:
    """Whether all of an entry of `TABLE` is below a folder; not whether it is right."""
    parts = [file.file for file in single_files(name)]
    parts += [archive.folder for archive in TABLE[name].archives]
    return all((folder / part).exists() for part in parts)


def get(name: str, folder: Path, *, keep_archives: bool = False, progress: Progress | None = None) -> Brought:
    """Bring published data into a folder, in the layout of its reader. An interrupted one goes on where it stopped.

    Args:
        name: of `TABLE`.
        folder: where to; made if need be.
        keep_archives: leave them beside what was unpacked from them.
        progress: called with a file's name, the bytes of it that are there, and their final number (None if unknown).

    Raises:
        InputError: no such name; too little room; a file that cannot be got, or is another one than was published
            (`pipeline.downloads.get`); an archive that cannot be unpacked.
    """
    data = downloads.named(name, TABLE, "published data")
    files = single_files(name)
    todo = [archive for archive in data.archives if not (folder / archive.folder).is_dir()]
    _check_room(folder, _bytes_to_come(folder, [archive.file for archive in todo], files))
    count, downloaded, first_use = len(files), 0, list[str]()
    for file in [*files, *(archive.file for archive in todo)]:
        result = downloads.get(file, folder, progress=progress and partial(progress, file.file))
        downloaded += result.downloaded
        first_use += [file.file] if result.trust == "first use" else []
    for archive in todo:
        count += unpack(folder / archive.file.file, archive.folder, folder / archive.folder, progress)
        if not keep_archives:
            (folder / archive.file.file).unlink()
    kept = [folder / archive.folder for archive in data.archives if archive not in todo]
    return Brought(count, downloaded, tuple(kept), tuple(first_use))


def unpack(archive: Path, part: str, target: Path, progress: Progress | None = None) -> int:
    """Unpack one folder of an archive; the target is there as a whole, or not at all.

    Args:
        archive: a zip file or tar file, compressed or not.
        part: folder of it, as ``training/image_2``.
        target: folder that takes what this folder holds.
        progress: called with the target's name, the files that are unpacked, and None.

    Returns:
        how many files it has.

    Raises:
        InputError: the archive is damaged, or has no such folder.
    """
    count = 0
    try:
        with replacing_folder(target) as temporary:
            for name, stream in _members(archive, PurePosixPath(part)):
                path = temporary / name
                path.parent.mkdir(parents=True, exist_ok=True)
                with path.open("wb") as file:
                    shutil.copyfileobj(stream, file, 1 << 20)
                count += 1
                if progress is not None:
                    progress(f"unpacking {part}", count, None)
            if not count:
                raise InputError(f"{archive}: no folder {part} in this archive; it is another one than was expected")
    except (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError) as error:
        raise InputError(
            f"{archive}: cannot be unpacked ({error}); delete it and run the same command again"
        ) from error
    return count


def _members(archive: Path, part: PurePosixPath) -> Iterator[tuple[PurePosixPath, IO[bytes]]]:
    """Files below a folder of an archive: names relative to it, and their open contents, in the archive's order."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as packed:
            for info in packed.infolist():
                inside = _inside(info.filename, part)
                if inside is not None and not info.is_dir():
                    with packed.open(info) as stream:
                        yield inside, stream
        return
    with tarfile.open(archive, "r:*") as packed_tar:
        for member in packed_tar:
            inside = _inside(member.name, part)
            content = packed_tar.extractfile(member) if inside is not None and member.isreg() else None
            if inside is not None and content is not None:
                yield inside, content


def _inside(name: str, part: PurePosixPath) -> PurePosixPath | None:
    """A member's name relative to a folder; None where it is not below it, or would leave it."""
    path = PurePosixPath(name)  # "./a" is "a"
    if not path.is_relative_to(part) or ".." in path.parts or path == part:
        return None
    return path.relative_to(part)


def _bytes_to_come(folder: Path, archives: list[PublishedFile], files: list[PublishedFile]) -> int:
    """Bytes that a download adds to a folder, as far as they are published; archives take as many again unpacked."""
    absent = [file for file in (*archives, *files) if not (folder / file.file).is_file()]
    return sum(file.size_bytes or 0 for file in (*absent, *archives))


def _check_room(folder: Path, needed: int) -> None:
    """Refuse a download that does not fit."""
    above = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())
    free = shutil.disk_usage(above).free
    if free < needed:
        raise InputError(
            f"{printable(folder)}: {needed / 1e9:.1f} GB are needed, with room to unpack, and {free / 1e9:.1f} GB are "
            "free; give a folder on another disk"
        )
