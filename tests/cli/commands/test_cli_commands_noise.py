"""``camera-monitor noise``: the noise that was added, in text, table and map; what cannot be used is named."""

import cv2
import numpy as np
import pandas as pd
import pytest
from cli_makers import call, noisy
from data_makers import picture

from pipeline import noise
from pipeline.noise.base import NoiseEstimate


@pytest.mark.parametrize("sigma_dn", [5.0, 15.0])
def test_noise_finds_what_was_added(tmp_path, sigma_dn):
    done = call("noise", noisy(tmp_path / "a.png", sigma_dn), "--csv", tmp_path / "t.csv", "--map", tmp_path / "maps")
    assert done.exit_code == 0, done.output
    level, at_most = (float(word) for word in done.output.splitlines()[1].split()[:2])
    assert abs(level - sigma_dn) < 0.1 * sigma_dn and level < at_most
    table = pd.read_csv(tmp_path / "t.csv")
    assert len(table) == 12  # 448 x 320 covered by 4 x 3 tiles
    assert (table["frame_sigma_dn"].round(2) == level).all()
    assert (table["sigma_at_most_dn"] >= table["sigma_dn"])[~table["abstained"]].all()
    assert cv2.imread(str(tmp_path / "maps/a.png.noise.png")).shape == (320, 448, 3)
    white, correlation = (float(word) for word in done.output.splitlines()[1].split()[6:8])
    assert (table["frame_white_sigma_dn"].round(2) == white).all() and white == pytest.approx(sigma_dn, rel=0.1)
    assert (table["frame_noise_correlation"].round(2) == correlation).all() and abs(correlation) < 0.05
    assert (table["white_sigma_dn"] <= table["sigma_dn"] + 1e-4)[~table["abstained"]].all()
    assert table["noise_correlation"].notna().equals(~table["abstained"])


def test_a_frame_without_noise_level_has_no_number_on_its_map(tmp_path, monkeypatch):
    class MostlyCompressed:
        def estimate(self, patches):
            reason = np.full(len(patches), "compressed", object)
            reason[0] = ""
            sigma_dn = np.full(len(patches), np.nan)
            sigma_dn[0] = 9.0
            bound = np.full(len(patches), 12.5)
            return NoiseEstimate(sigma_dn, sigma_dn, sigma_dn, reason != "", reason, at_most_dn=bound)

    path = noisy(tmp_path / "a.png", 5.0)
    monkeypatch.setattr(noise, "create", lambda name: MostlyCompressed())
    done = call("noise", path, "--csv", tmp_path / "t.csv", "--map", tmp_path / "maps")
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[1].split()[:8] == ["-", "12.50", "-", "-", "12", "11", "-", "-"]
    table = pd.read_csv(tmp_path / "t.csv")
    assert table["sigma_dn"][0] == 9.0 and table["frame_sigma_dn"].isna().all()  # so that tile is not to be trusted
    assert (table["sigma_at_most_dn"] == 12.5).all()
    drawn, image = (cv2.imread(str(file)).astype(int) for file in (tmp_path / "maps/a.png.noise.png", path))
    assert np.ptp(drawn[:128, :128], axis=2).max() == 0  # crossed out, without a colour
    assert (drawn != image).any()


def test_noise_reads_videos(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (448, 320))
    for number in range(4):
        writer.write(cv2.cvtColor(picture(str(number)), cv2.COLOR_GRAY2BGR))
    writer.release()
    done = call("noise", tmp_path / "v.avi", "--every", 2)
    assert done.exit_code == 0, done.output
    assert "v.avi#0" in done.output
    assert "v.avi#2" in done.output
    assert "v.avi#1" not in done.output


def test_noise_sets_a_broken_file_aside_and_fails(tmp_path):
    noisy(tmp_path / "good.png", 5.0)
    (tmp_path / "bad.png").write_bytes((tmp_path / "good.png").read_bytes()[:2000])
    done = call("noise", tmp_path)
    assert done.exit_code == 2
    assert "good.png" in done.output
    assert "set aside" in done.output
    assert "bad.png" in done.output


@pytest.mark.parametrize(("estimator", "least_px"), [("pca", 32), ("wavelet", 16)])
def test_pictures_that_are_too_small_are_told_what_the_estimator_needs(tmp_path, estimator, least_px):
    for side in (1, least_px - 1, least_px):
        noisy(tmp_path / f"{side}.png", 5.0)
        image = cv2.imread(str(tmp_path / f"{side}.png"))[:side, :side]
        cv2.imwrite(str(tmp_path / f"{side}.png"), image)
    done = call("noise", tmp_path, "--estimator", estimator, "--tile", least_px)
    aside = [line for line in done.stderr.splitlines() if line.startswith("set aside")]
    assert [line.split(": ", 2)[2] for line in aside] == [
        f"too small: {side}x{side} px, expected at least {least_px} px on either side" for side in (1, least_px - 1)
    ]
    assert [line.split()[-1] for line in done.stdout.splitlines()[1:]] == [str(tmp_path / f"{least_px}.png")]


def test_a_video_of_small_frames_is_set_aside_once(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (40, 24))
    for _ in range(3):
        writer.write(np.full((24, 40, 3), 90, np.uint8))
    writer.release()
    done = call("noise", tmp_path / "v.avi", "--estimator", "pca")
    aside = [line for line in done.stderr.splitlines() if line.startswith("set aside")]
    assert len(aside) == 1 and "v.avi: too small: 40x24 px, expected at least 32 px" in aside[0]
