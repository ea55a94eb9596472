"""Flags of frames: raised by what they name, never by an ordinary picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.condition.frame_flags import SATURATED_DN, FrameInspector, measure
from pipeline.streams import stream

IMAGE = picture("flags").astype(np.float32) / np.float32(255)


def noise(level_dn: float, sigma_dn: float = 1.0) -> np.ndarray:
    drawn = stream(0, "flags", level_dn).normal(level_dn, sigma_dn, IMAGE.shape)
    return (np.clip(np.rint(drawn), 0, 255) / 255).astype(np.float32)


@pytest.mark.parametrize(
    ("image", "names"),
    [
        (IMAGE, ()),
        (noise(2.0), ("black",)),
        (np.zeros_like(IMAGE), ("black",)),
        ((0.1 * IMAGE).astype(np.float32), ("dark",)),
        (noise(254.0), ("over_exposed",)),
        (np.clip(2.5 * IMAGE, 0, 1), ("over_exposed",)),
        (noise(60.0), ()),
    ],
)
def test_exposure_flags(image, names):
    assert FrameInspector().inspect(image).names == names


def obstructed(image: np.ndarray, share: float, level_dn: float = 15.0, sigma_dn: float = 2.0) -> np.ndarray:
    """The picture with an out-of-focus dark object over its left part."""
    across = np.arange(image.shape[1]) / image.shape[1]
    cover = np.clip((share + 0.03 - across) / 0.06, 0, 1)[None]
    grain = stream(0, "obstruction", share).normal(0, sigma_dn, image.shape) * cover
    levels = 255 * image * (1 - cover) + level_dn * cover + grain
    return (np.clip(np.rint(levels), 0, 255) / 255).astype(np.float32)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2, 0.4, 0.7])
def test_an_obstruction_is_measured_and_flagged(share):
    flags = FrameInspector().inspect(obstructed(IMAGE, share) if share else IMAGE)
    assert flags.obstructed_fraction == pytest.approx(share, abs=0.06)
    assert ("obstructed" in flags.names) == (share > 0.1)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [1, -1])
@pytest.mark.parametrize(("level", "share", "name"), [(1.0, 0.4, "over_exposed"), (0.0, 0.4, "obstructed")])
def test_a_white_or_black_area_across_the_frame_is_no_bar(axis, end, level, share, name):
    image = np.moveaxis(IMAGE.copy(), axis, 0)
    image[::end][: round(share * len(image))] = level
    flags = FrameInspector().inspect(np.ascontiguousarray(np.moveaxis(image, 0, axis)))
    assert name in flags.names
    measured = flags.saturated_fraction if level else flags.obstructed_fraction
    assert measured == pytest.approx(share, abs=0.06)


def test_an_area_that_is_left_of_a_dark_frame_is_not_over_exposed():
    image = np.zeros_like(IMAGE)
    lit = slice(len(image) // 3)
    image[lit] = np.clip(2.5 * IMAGE, 0, 1)[lit]
    names = FrameInspector().inspect(image).names
    assert "dark" in names and "over_exposed" not in names


@pytest.mark.parametrize("level", [0.0, 16 / 255])
@pytest.mark.parametrize("widths", [(80, 80), (60, 40), (16, 0), (0, 24)])
def test_paired_and_narrow_dark_bars_are_left_out(level, widths):
    boxed = cv2.copyMakeBorder(IMAGE, *widths, 0, 0, cv2.BORDER_CONSTANT, value=level)
    first = -(-widths[0] // 8) * 8 - widths[0]  # lines of the picture before the first block of a codec
    assert measure(boxed) == measure(IMAGE[first:])


def test_neither_a_bright_smooth_area_nor_a_picture_without_structure_is_obstructed():
    assert FrameInspector().inspect(obstructed(IMAGE, 0.4, level_dn=180.0)).obstructed_fraction < 0.05
    assert FrameInspector().inspect(noise(60.0)).obstructed_fraction == 0.0


@pytest.mark.shared
def test_clear_street_pictures_are_not_obstructed(shared):
    from pipeline.datasets.decoding.pictures import read_grey

    files = sorted((shared / "realdata/kitti_more/training/image_2").glob("*.png"))[::7]
    files += sorted((shared / "realdata/pennfudan/PNGImages").glob("*.png"))[::9]
    if not files:
        pytest.skip("street pictures absent: ../shared/realdata")
    for file in files:
        image = read_grey(file)
        assert FrameInspector().inspect(image).obstructed_fraction < 0.08, file.name
        assert FrameInspector().inspect(obstructed(image, 0.4)).obstructed_fraction > 0.2, file.name


@pytest.mark.parametrize(("axis", "measure_name"), [(1, "row_noise_dn"), (0, "column_noise_dn")])
def test_noise_of_whole_rows_or_columns_is_flagged(axis, measure_name):
    shape = [1, 1]
    shape[1 - axis] = IMAGE.shape[1 - axis]
    offsets = stream(0, "flags", "offsets", axis).normal(0, 8.0, shape)
    flags = FrameInspector().inspect((np.clip(np.rint(255 * IMAGE + offsets), 0, 255) / 255).astype(np.float32))
    assert flags.names == ("banded",)
    assert getattr(flags, measure_name) == pytest.approx(8.0, rel=0.2)


@pytest.mark.parametrize("level", [0.0, 1.0, None])
@pytest.mark.parametrize("axis", [0, 1])
def test_dead_hot_and_half_gain_lines_are_flagged(level, axis):
    """Four of them, which noise of most lines does not see."""
    image = np.moveaxis(IMAGE.copy(), axis, 0)
    image[[40, 41 + 30, 150, 200]] *= 0.5 if level is None else 0.0
    image[[40, 41 + 30, 150, 200]] += level or 0.0
    flags = FrameInspector().inspect(np.ascontiguousarray(np.moveaxis(image, 0, axis)))
    assert flags.names == ("dead_lines",) and 3 <= flags.dead_lines <= 4
    assert max(flags.row_noise_dn, flags.column_noise_dn) < 1


@pytest.mark.parametrize("blur_px", [0.6, 0.8, 1.0])
def test_a_thin_line_of_the_scene_is_no_dead_one(blur_px):
    """A cable across the frame, as dark as a dead row; the lens spreads it over its neighbours."""
    cable = np.zeros_like(IMAGE)
    cable[100] = 0.5
    sharp, seen = (np.clip(IMAGE - line, 0, 1) for line in (cable, cv2.GaussianBlur(cable, (0, 0), blur_px)))
    assert FrameInspector().inspect(sharp).dead_lines == 1
    assert FrameInspector().inspect(seen).dead_lines == 0


def test_a_dead_row_shows_beside_black_parts_of_the_frame():
    image = IMAGE.copy()
    image[:, int(0.35 * image.shape[1]) : int(0.65 * image.shape[1])] = 2 / 255  # where a row cannot show
    assert FrameInspector().inspect(image).dead_lines == 0
    image[100] = 0
    assert FrameInspector().inspect(image).dead_lines == 1


def test_lines_are_not_counted_where_noise_of_all_rows_hides_them():
    offsets = stream(0, "flags", "banded and dead").normal(0, 8.0, (IMAGE.shape[0], 1))
    levels = np.clip(np.rint(255 * IMAGE + offsets), 0, 255)
    levels[[60, 150]] = 0
    flags = FrameInspector().inspect((levels / 255).astype(np.float32))
    assert flags.dead_lines and flags.names == ("banded",)


def test_a_lamp_at_night_does_not_make_the_dark_an_obstruction():
    image = noise(2.0)
    image[40:56, 60:76] = 250 / 255
    flags = FrameInspector().inspect(image)
    assert flags.obstructed_fraction > 0.9 and flags.names == ("black",)


def test_a_dark_part_with_structure_is_no_obstruction():
    """A tunnel's wall, not something on the lens."""
    dark, image = np.rint(0.15 * picture("dark part", *IMAGE.shape[::-1])) / 255, IMAGE.copy()
    half = 2 * image.shape[1] // 5
    image[:, :half] = dark[:, :half]
    assert FrameInspector().inspect(image).obstructed_fraction < 0.06
    assert FrameInspector().inspect(obstructed(IMAGE, 0.4, level_dn=20.0)).obstructed_fraction > 0.3


def test_in_a_dim_frame_shadows_do_not_count_as_an_obstruction():
    """What has structure is nearly as dark as what has none."""
    covered = obstructed(IMAGE, 0.4)
    assert FrameInspector().inspect(covered).obstructed_fraction > 0.3
    dim = np.rint(255 * covered * 0.15) / 255
    assert FrameInspector().inspect(dim.astype(np.float32)).obstructed_fraction == 0


@pytest.mark.shared
def test_scenes_have_no_dead_lines(shared):
    """Stairs and tiles of PolyU among them, whose edges cross the whole crop."""
    from pipeline.datasets.decoding.pictures import read_grey

    folder = shared / "realdata"
    files = [*sorted((folder / "polyu").glob("*_real.*"))[::3], *sorted((folder / "kitti_more").rglob("*.png"))[::7]]
    if not files:
        pytest.skip("pictures absent: ../shared/realdata")
    assert not any(measure(read_grey(file)).dead_lines for file in files)


def test_impulses_are_flagged():
    drawn = stream(0, "flags", "impulses").random(IMAGE.shape)
    flags = FrameInspector().inspect(np.where(drawn < 0.005, 0, np.where(drawn > 0.995, 1, IMAGE)).astype(np.float32))
    assert flags.names == ("impulses",)
    assert 0.005 < flags.impulse_fraction < 0.012


def test_frames_too_small_for_lines_and_impulses_are_not_flagged_for_them():
    flags = FrameInspector().inspect(stream(0, "flags", "small").random((40, 40), dtype=np.float32))
    assert np.isnan([flags.row_noise_dn, flags.column_noise_dn, flags.impulse_fraction]).all()
    assert not {"banded", "impulses"} & set(flags.names)


def test_measures_are_in_grey_levels():
    flags = FrameInspector().inspect(IMAGE)
    assert flags.median_dn == pytest.approx(np.median(picture("flags")), abs=1e-3)
    assert flags.saturated_fraction == np.mean(picture("flags") >= 250)


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (37, 53), (300, 700)])
@pytest.mark.parametrize("scale", [0.0, 0.01, 0.5, 1.0])
def test_measures_of_pictures_that_are_not_of_whole_levels_are_numpys(shape, scale):
    """As colour pictures are when they become grey, which is not rounded."""
    image = np.asarray(scale * stream(0, "flags", *shape).random(shape, dtype=np.float32), dtype=np.float32)
    levels = 255 * image
    measures = measure(image)
    assert measures.bright_dn == pytest.approx(np.percentile(levels, 99), abs=1e-4)
    assert measures.median_dn == pytest.approx(np.median(levels), abs=1e-4)
    assert measures.saturated_fraction == np.mean(levels >= SATURATED_DN - 0.5)


def test_a_stream_freezes_after_three_repeats_and_thaws():
    inspector = FrameInspector()
    frames = [noise(100.0)] * 5 + [noise(101.0)] * 2
    assert [inspector.inspect(frame, "v.mp4").repeats for frame in frames] == [0, 1, 2, 3, 4, 0, 1]
    inspector = FrameInspector()
    assert [inspector.inspect(frame, "v.mp4").names for frame in frames] == [()] * 3 + [("frozen",)] * 2 + [()] * 2


def test_equal_pictures_and_equal_frames_of_two_streams_are_not_frozen():
    inspector = FrameInspector()
    assert [inspector.inspect(IMAGE).repeats for _ in range(5)] == [0] * 5
    assert [inspector.inspect(IMAGE, f"{number}.mp4").repeats for number in range(5)] == [0] * 5


@pytest.mark.parametrize("shape", [(30, 41), (192, 256), (1, 7), (400, 700)])
def test_measures_of_grey_levels_are_those_of_numpy(shape):
    draws = stream(0, "frame flags", "percentiles", str(shape))
    whole = (draws.integers(0, 256, shape) / 255).astype(np.float32)
    between = draws.uniform(0, 1, shape).astype(np.float32)
    for image in (whole, between, np.where(between > 0.9, whole, between)):
        levels = 255.0 * image
        measures = measure(image)
        assert (measures.bright_dn, measures.median_dn) == pytest.approx(np.percentile(levels, (99, 50)), rel=1e-6)
        assert measures.saturated_fraction == pytest.approx(np.mean(levels >= SATURATED_DN - 0.5), abs=1e-12)


def test_frames_read_into_one_buffer_are_not_frozen():
    buffer, inspector = np.empty((96, 128), np.float32), FrameInspector()
    for index in range(6):
        buffer[:] = stream(1, "buffer", index).uniform(0, 1, buffer.shape)
        assert inspector.inspect(buffer, "camera").repeats == 0
