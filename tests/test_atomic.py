import os
import subprocess
import sys
from pathlib import Path

import pytest

from spa_fo.atomic import filling, replacing, write_text
from spa_fo.errors import BadInput


def test_the_file_appears_whole(tmp_path: Path) -> None:
    write_text(tmp_path / "new" / "a.txt", "α\n")
    assert (tmp_path / "new" / "a.txt").read_bytes() == "α\n".encode()
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.txt"]


def test_a_failing_block_leaves_the_earlier_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("earlier")

    def fail_half_way() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_a_read_only_place_is_bad_input() -> None:
    # /proc takes no new files, not even from root.
    with pytest.raises(BadInput, match=r"/proc/a\.txt: cannot be written"):
        write_text("/proc/a.txt", "text")


def test_what_is_no_file_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path):
        with pytest.raises(BadInput, match="is not a file"):
            write_text(path, "text")
    assert pipe.is_fifo()


def test_a_full_disk_is_bad_input_and_leaves_the_earlier_file(tmp_path: Path) -> None:
    # A limit on the file's size stands for the full disk: the write fails half-way.
    path = tmp_path / "a.txt"
    path.write_text("earlier")
    code = (
        "import resource, signal, sys\n"
        "from spa_fo.atomic import write_text\n"
        "from spa_fo.edge import bad_input_exits\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "with bad_input_exits():\n"
        "    write_text(sys.argv[1], 'x' * 5000)\n"
    )
    run = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr.startswith(f"spa-fo: {path}: cannot be written: ")
    assert run.stderr.count("\n") == 1
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_the_umask_is_respected(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "")
    (tmp_path / "b.txt").write_text("")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_a_folder_is_filled_when_all_its_files_are_there(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    with filling(folder) as temporary:
        write_text(temporary / "a.txt", "a")
        write_text(temporary / "b.txt", "b")
        assert [path for path in folder.iterdir() if path.is_file()] == []
    assert {path.name: path.read_text() for path in folder.iterdir()} == {
        "a.txt": "a",
        "b.txt": "b",
    }


def test_a_folder_that_could_not_be_filled_is_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a.txt").write_text("earlier")

    def fail_at_the_second_file(folder: Path) -> None:
        with filling(folder) as temporary:
            write_text(temporary / "a.txt", "a")
            write_text(temporary / "a.txt" / "b.txt", "b")

    for name in ("old", "new"):
        with pytest.raises(BadInput) as caught:
            fail_at_the_second_file(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}/a.txt/b.txt: cannot be written")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert [path.name for path in (tmp_path / "old").iterdir()] == ["a.txt"]
    assert (tmp_path / "old" / "a.txt").read_text() == "earlier"
