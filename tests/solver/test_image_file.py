"""EXR files: what is written is read back, the right way up, or one clear line says why not."""

import os

import numpy as np
import pytest
from radiosity.solver.errors import OutputError
from radiosity.solver.image_file import read_exr, read_layers, write_exr


def picture(height=5, width=7):
    return np.random.default_rng(1).uniform(0, 1e5, (height, width, 3)).astype(np.float32)


def test_float_pixels_come_back_bit_for_bit(tmp_path):
    # 5 x 7 random values up to 1e5: float32 in, the same float32 out.
    pixels = picture()
    write_exr(tmp_path / "a.exr", pixels)
    assert np.array_equal(read_exr(tmp_path / "a.exr"), pixels)


def test_half_pixels_keep_three_digits_and_hold_the_largest(tmp_path):
    # Half floats have 11 bits: relative error at most 2^-11; above 65,504 they stay there.
    pixels = picture()
    write_exr(tmp_path / "a.exr", pixels, half=True)
    assert np.allclose(read_exr(tmp_path / "a.exr"), np.minimum(pixels, 65504), rtol=2**-11)


def test_the_file_s_first_row_is_the_top(tmp_path):
    # Row 2 of 3, v towards 1, is white: OpenEXR itself must see it in the file's row 0.
    import OpenEXR

    pixels = np.zeros((3, 4, 3), np.float32)
    pixels[2] = 1
    write_exr(tmp_path / "a.exr", pixels)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert file.channels()["R"].pixels[:, 0].tolist() == [1, 0, 0]


def test_the_header_says_what_the_numbers_are(tmp_path):
    # Text and numbers given as attributes: the same come back.
    write_exr(tmp_path / "a.exr", picture(), {"quantity": "irradiance", "unit": "W/m2", "exposure": 1.5})
    assert read_layers(tmp_path / "a.exr")[1] == {"quantity": "irradiance", "unit": "W/m2", "exposure": 1.5}


def test_light_groups_are_layers_of_one_file(tmp_path):
    # Three images, two of them named: all come back under their names.
    images = {"": picture(), "sun": picture() * 2, "lamps.north": picture() * 3}
    write_exr(tmp_path / "a.exr", images[""], layers={"sun": images["sun"], "lamps.north": images["lamps.north"]})
    layers, _ = read_layers(tmp_path / "a.exr")
    assert sorted(layers) == sorted(images)
    assert all(np.array_equal(layers[name], images[name]) for name in images)


@pytest.mark.parametrize("name", ["missing/a.exr", "folder"])
def test_a_path_that_cannot_be_written_is_one_line_and_leaves_nothing(tmp_path, name):
    # A missing folder, and a folder where the file should be: OutputError that names the path, no file left.
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError) as caught:
        write_exr(tmp_path / name, picture())
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert os.listdir(tmp_path) == ["folder"]
    assert os.listdir(tmp_path / "folder") == []


def test_a_failure_while_writing_keeps_the_old_file_and_no_other(tmp_path):
    # An attribute that OpenEXR refuses (its name is the reserved type of another): the old file stays as it was.
    write_exr(tmp_path / "a.exr", picture())
    before = (tmp_path / "a.exr").read_bytes()
    with pytest.raises(OutputError):
        write_exr(tmp_path / "a.exr", picture() * 2, {"chromaticities": "none"})
    assert (tmp_path / "a.exr").read_bytes() == before
    assert os.listdir(tmp_path) == ["a.exr"]


def test_a_name_that_is_too_long_is_one_line(tmp_path):
    # Longer than the system takes, of a file and of its folder. Exact answer: OutputError, to be written and read.
    for path in (tmp_path / ("x" * 300), tmp_path / ("x" * 300) / "a.exr"):
        with pytest.raises(OutputError):
            write_exr(path, picture())
        with pytest.raises(OutputError):
            read_exr(path)


@pytest.mark.parametrize("content", [None, b"", b"this is no image"])
def test_a_file_that_cannot_be_read_is_one_line(tmp_path, content):
    # Not there, empty, and text: OutputError in one line that names the file.
    path = tmp_path / "b.exr"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(OutputError) as caught:
        read_exr(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_pixels_of_the_wrong_shape_are_refused(tmp_path):
    # Four channels, or a layer of another size: refused before any file is touched.
    with pytest.raises(OutputError):
        write_exr(tmp_path / "a.exr", np.zeros((2, 2, 4), np.float32))
    with pytest.raises(OutputError):
        write_exr(tmp_path / "a.exr", picture(), layers={"sun": picture(2, 2)})
    assert os.listdir(tmp_path) == []
