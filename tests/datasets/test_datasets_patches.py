"""Patches: always inside, covering what they promise, with the counts the paper and its authors' program have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.datasets.frame import Box
from pipeline.datasets.patches import Patch, cut, object_patches, tiles
from pipeline.errors import InputError

UDACITY, KITTI, SIM = (1200, 1920), (375, 1242), (768, 896)
sizes = st.integers(1, 700)


def covered(shape, patches):
    mask = np.zeros(shape, bool)
    for patch in patches:
        mask[patch.y_px : patch.y_px + patch.size_px, patch.x_px : patch.x_px + patch.size_px] = True
    return mask


def inside(shape, patches):
    return all(
        p.x_px >= 0 and p.x_px + p.size_px <= shape[1] and p.y_px >= 0 and p.y_px + p.size_px <= shape[0]
        for p in patches
    )


@pytest.mark.parametrize(
    ("shape", "policy", "columns", "rows"),
    [
        (UDACITY, "complete", 15, 9),
        (UDACITY, "cover", 15, 10),
        (KITTI, "complete", 9, 2),
        (KITTI, "cover", 10, 3),
        (SIM, "complete", 7, 6),
        (SIM, "cover", 7, 6),
    ],
)
def test_tile_counts_of_the_paper(shape, policy, columns, rows):
    result = tiles(shape, 128, policy)
    assert len(result) == columns * rows
    assert len({p.x_px for p in result}) == columns
    assert len({p.y_px for p in result}) == rows


def test_last_row_of_udacity_overlaps():
    assert sorted({p.y_px for p in tiles(UDACITY, 128, "cover")})[-2:] == [1024, 1072]
    assert {p.y_px for p in tiles(KITTI, 128, "cover")} == {0, 128, 247}


def test_orders():
    assert [(p.x_px, p.y_px) for p in tiles((256, 256), 128)] == [(0, 0), (128, 0), (0, 128), (128, 128)]


@given(height=sizes, width=sizes, size_px=st.integers(1, 260))
def test_tiles_of_any_frame(height, width, size_px):
    shape = (height, width)
    complete, cover = (tiles(shape, size_px, policy) for policy in ("complete", "cover"))
    for item in (complete, cover):
        assert inside(shape, item)
        assert len(set(item)) == len(item)
    assert len(complete) == (height // size_px) * (width // size_px)
    assert set(complete) <= set(cover)
    assert covered(shape, complete).sum() == len(complete) * size_px**2  # they do not overlap
    if min(shape) >= size_px:
        assert covered(shape, cover).all()
        assert len(cover) == -(-height // size_px) * -(-width // size_px)
    else:
        assert cover == []


@st.composite
def framed_boxes(draw):
    height, width = draw(st.integers(192, 900)), draw(st.integers(192, 900))
    boxes = []
    for _ in range(draw(st.integers(1, 6))):
        x1, y1 = draw(st.floats(-50, width + 20)), draw(st.floats(-50, height + 20))
        w, h = draw(st.floats(0.5, 800)), draw(st.floats(0.5, 800))
        boxes.append(Box("car", x1, y1, x1 + w, y1 + h, draw(st.booleans())))
    return (height, width), boxes


@given(framed_boxes())
def test_object_patches_stay_inside_and_meet_their_objects(case):
    shape, boxes = case
    result = object_patches(shape, boxes)
    assert inside(shape, result)
    assert {p.label for p in result} <= {"car"}
    wanted = [b.clipped(shape[1], shape[0]) for b in boxes if not b.ignore]
    every = object_patches(shape, boxes, same_iou=1.01)  # nothing is taken for the same patch
    mask = covered(shape, every)
    for box in filter(None, wanted):
        assert mask[int(box.y1) : int(np.ceil(box.y2)), int(box.x1) : int(np.ceil(box.x2))].all()
    assert bool(result) == any(box is not None for box in wanted)
    for number, one in enumerate(result):  # no two are the same by the rule
        for other in result[:number]:
            dx, dy = abs(one.x_px - other.x_px), abs(one.y_px - other.y_px)
            overlap = max(0, 192 - dx) * max(0, 192 - dy)
            assert overlap / (2 * 192**2 - overlap) < 0.7


def test_object_rule_by_hand():
    frame = (500, 600)
    one = object_patches(frame, [Box("car", 100.4, 50.6, 180, 120)])
    assert one == [Patch(100, 50, 192, "car")]  # extended right and down
    wide = object_patches(frame, [Box("car", 10, 20, 210, 100)])
    assert [(p.x_px, p.y_px) for p in wide] == [(10, 20), (202, 20)]
    border = object_patches(frame, [Box("car", 550, 400, 590, 480)])
    assert border == [Patch(408, 308, 192, "car")]  # shifted back inside
    exact = [Box("car", 0, 0, 192, 100)]
    assert [p.x_px for p in object_patches(frame, exact)] == [0, 192]  # a multiple gets one more
    assert [p.x_px for p in object_patches(frame, exact, one_more=False)] == [0]
    near = [Box("car", 100, 100, 150, 150), Box("van", 110, 105, 150, 150), Box("van", 180, 100, 220, 150)]
    assert [(p.x_px, p.label) for p in object_patches(frame, near)] == [(100, "car"), (180, "van")]
    apart = [Box("car", 100, 100, 150, 150), Box("van", 148, 100, 190, 150)]  # share 3/4 of each, 3/5 of their union
    assert [p.x_px for p in object_patches(frame, apart)] == [100, 148]
    assert object_patches(frame, [Box("car", 0, 0, 50, 50, ignore=True)]) == []
    assert object_patches((191, 600), [Box("car", 0, 0, 50, 50)]) == []


@given(st.integers(20, 90), st.integers(20, 90), st.integers(1, 20))
def test_cut_takes_the_pixels(height, width, size_px):
    image = np.arange(height * width, dtype=np.float32).reshape(height, width) / (height * width)
    patches = tiles((height, width), size_px, "cover")
    pieces = cut(image, patches)
    assert pieces.shape == (len(patches), 1, size_px, size_px)
    assert pieces.dtype == np.float32
    for piece, patch in zip(pieces, patches, strict=True):
        assert piece[0, 0, 0] == image[patch.y_px, patch.x_px]
        assert piece[0, -1, -1] == image[patch.y_px + size_px - 1, patch.x_px + size_px - 1]
    pieces += 1  # a copy
    assert image.max() < 1


def test_cut_of_eight_bit_and_of_nothing():
    image = np.full((30, 30), 51, np.uint8)
    assert np.allclose(cut(image, [Patch(1, 2, 8)]), 0.2)
    assert cut(image, []).shape == (0, 1, 0, 0)


@pytest.mark.parametrize(
    ("patches", "message"),
    [
        ([Patch(0, 0, 8), Patch(0, 0, 9)], "expected one size"),
        ([Patch(25, 0, 8)], "leaves the image of 30x30"),
        ([Patch(-1, 0, 8)], "leaves the image"),
    ],
)
def test_cut_refuses(patches, message):
    with pytest.raises(InputError, match=message):
        cut(np.zeros((30, 30), np.float32), patches)


@pytest.mark.parametrize("kind", [np.uint16, np.int64, bool, complex])
def test_cut_refuses_images_of_unknown_full_scale(kind):
    for patches in ([Patch(0, 0, 8)], []):
        with pytest.raises(InputError, match=f"got {np.dtype(kind)}; divide by its full scale"):
            cut(np.zeros((30, 30), kind), patches)


def test_bad_arguments():
    with pytest.raises(InputError, match="policy='some'"):
        tiles((200, 200), 128, "some")
    with pytest.raises(InputError, match="at least 1"):
        tiles((200, 200), 0)
    with pytest.raises(InputError, match=r"expected \(height, width\)"):
        object_patches((3, 200, 200), [])
    with pytest.raises(InputError, match=r"expected \(H, W\)"):
        cut(np.zeros((1, 30, 30)), [Patch(0, 0, 8)])
