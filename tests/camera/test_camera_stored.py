"""A bank survives its files."""

import numpy as np
import pytest

from pipeline import store
from pipeline.camera import mtf
from pipeline.camera.psf import stored
from pipeline.camera.psf.bank import bank
from pipeline.errors import InputError


def test_a_bank_read_back_is_the_bank_written(tmp_path):
    kernels = bank(["defocus", "linear_motion"], [3, 7], [0, 45])
    rows = stored.write(tmp_path, kernels, "generated")
    back = stored.read(tmp_path)
    assert [(k.name, k.kind, k.size_px, k.angle_deg) for k in back] == [
        (k.name, k.kind, k.size_px, k.angle_deg) for k in kernels
    ]
    assert all(np.allclose(one.psf, other.psf, atol=1e-7) for one, other in zip(kernels, back, strict=True))
    assert len(rows) == len(kernels) * 2 * len(mtf.FREQUENCIES)
    first = rows[rows["kernel"] == kernels[0].name].sort_values(["axis", "frequency"])["mtf"].to_numpy()
    assert np.allclose(first.reshape(2, -1), mtf.sample(kernels[0].psf))


def test_files_that_disagree_are_refused(tmp_path):
    stored.write(tmp_path, bank(["defocus"], [3], [0]), "generated")
    store.write_arrays(tmp_path / "kernels.npz", other=np.ones((1, 1)))
    with pytest.raises(InputError, match="different kernels"):
        stored.read(tmp_path)
