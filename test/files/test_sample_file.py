"""Height maps from files: arrays and pictures read, all else refused in one line."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imsave

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.plant_file import load_sample

RAMP = np.linspace(0.0, 1.0, 256).reshape(16, 16)
WHITE = 200e-9


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16])
def test_an_array_holds_metres(tmp_path: Path, dtype: type) -> None:
    heights = (100 * RAMP).astype(dtype)
    np.save(tmp_path / "map.npy", heights)
    loaded = load_sample(tmp_path / "map.npy", 1e-6, WHITE)
    np.testing.assert_array_equal(loaded.heights, heights)


def test_a_picture_is_as_high_as_white_is_said_to_be(tmp_path: Path) -> None:
    imsave(tmp_path / "map.png", RAMP, cmap="gray", vmin=0.0, vmax=1.0)
    loaded = load_sample(tmp_path / "map.png", 1e-6, WHITE)
    np.testing.assert_allclose(loaded.heights, WHITE * RAMP, atol=WHITE / 255)
    assert loaded.heights[0, 0] == 0.0
    assert loaded.heights[-1, -1] == pytest.approx(WHITE)


def test_what_is_no_map_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.npy").write_text("not an array", "utf-8")
    (tmp_path / "text.png").write_text("not a picture", "utf-8")
    np.save(tmp_path / "pickle.npy", np.array([{}, None], dtype=object), allow_pickle=True)
    np.save(tmp_path / "words.npy", np.array([["a", "b"], ["c", "d"]]))
    np.save(tmp_path / "line.npy", np.zeros(5))
    for name in ("text.npy", "text.png", "pickle.npy", "words.npy", "line.npy", "none.npy"):
        with pytest.raises(InputError, match=name):
            load_sample(tmp_path / name, 1e-6, WHITE)
