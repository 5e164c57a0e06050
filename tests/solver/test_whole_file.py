"""Files that appear whole or not at all."""

import os

import pytest
from radiosity.solver.errors import OutputError
from radiosity.solver.whole_file import whole_file


def test_a_file_takes_the_place_of_an_older_one_at_the_end(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with whole_file(path) as beside:
        beside.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize(("cause", "told", "words"), [
    (OSError(28, "No space left"), OutputError, r"a\.txt can't be written \(no space left\): check"),
    (OSError("the disk is gone\nfor good"), OutputError, r"a\.txt can't be written \(the disk is gone\): check"),
    (TimeoutError(), OutputError, r"a\.txt can't be written \(timeouterror\): check"),
    (ValueError("not ours"), ValueError, "not ours"),
])
def test_a_failure_leaves_the_older_file_and_no_other(tmp_path, cause, told, words):
    # Half of a file, then a failure: the system's, without the system's words or any, and another. Exact answer: the
    # older file, and one line for what is the system's.
    path = tmp_path / "a.txt"
    path.write_text("old")

    def write():
        with whole_file(path) as beside:
            beside.write_text("ne")
            raise cause

    with pytest.raises(told, match=words):
        write()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
