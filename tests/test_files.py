import os
import signal
import stat
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from elevon.errors import InputError, OutputError, OutputExistsError
from elevon.files import atomic_path, check_output, visible, write_bytes, write_text


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_writes_whole_and_leaves_nothing_else(tmp_path):
    path = write_text(tmp_path / "deep" / "a.txt", "één\n")
    assert path.read_bytes() == "één\n".encode()
    assert _names(path.parent) == ["a.txt"]


def test_the_content_reaches_the_disk_before_the_name_and_the_name_after(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(os, "fsync", lambda handle: calls.append(os.fstat(handle)))
    present = []
    link = os.link
    monkeypatch.setattr(os, "link", lambda *paths: (present.append(len(calls)), link(*paths)))
    path = write_text(tmp_path / "a.txt", "x")
    assert present == [1]
    assert [call.st_ino for call in calls] == [path.stat().st_ino, tmp_path.stat().st_ino]


def test_the_mode_is_that_of_any_new_file(tmp_path):
    (tmp_path / "plain").touch()
    path = write_bytes(tmp_path / "a", b"x")
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def test_existing_file_is_kept_unless_forced(tmp_path):
    path = write_text(tmp_path / "a.txt", "old")
    with pytest.raises(OutputExistsError, match=r"a\.txt.*force"):
        write_text(path, "new")
    assert path.read_text() == "old"
    write_text(path, "new", force=True)
    assert path.read_text() == "new"


def test_a_file_that_appears_meanwhile_is_kept(tmp_path):
    path = tmp_path / "a.txt"
    with pytest.raises(OutputExistsError, match="appeared"), atomic_path(path) as temporary:
        temporary.write_text("ours")
        path.write_text("theirs")
    assert path.read_text() == "theirs"
    assert _names(tmp_path) == ["a.txt"]


def test_a_failing_writer_leaves_the_old_file(tmp_path):
    path = write_text(tmp_path / "a.txt", "old")
    with pytest.raises(RuntimeError), atomic_path(path, force=True) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert _names(tmp_path) == ["a.txt"]


def test_what_a_killed_writer_left_is_not_read_as_a_file_of_its_folder(tmp_path, monkeypatch):
    from elevon.parameters.load import VARIABLE, set_names
    from elevon.prognose.history import read_history
    from elevon.report import Report

    Report("other").save(tmp_path / "a.html")
    for ending in ("html", "json", "toml"):
        (tmp_path / f".a.0123456789ab.part.{ending}").write_text((tmp_path / "a.html").read_text())
    assert visible(tmp_path, "*") == [tmp_path / "a.html"]
    page = Report("page")
    page.save(tmp_path / "page.html")
    assert list(page.beside) == ["a.html"]
    with pytest.raises(InputError, match="no inspections"):
        read_history(tmp_path, unit="h")
    names = set_names()
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert set_names() == names


def test_a_link_to_nowhere_counts_as_existing(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "gone")
    with pytest.raises(OutputExistsError):
        check_output(tmp_path / "a")


def test_a_folder_is_no_output(tmp_path):
    with pytest.raises(OutputError, match="is a folder"):
        check_output(tmp_path, force=True)


def test_a_folder_below_a_file_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot make the folder"):
        write_text(tmp_path / "file" / "a.txt", "x")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_read_only_folder_is_refused_before_work(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="not writable"):
        check_output(tmp_path / "a.txt")


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder nobody can write")
def test_an_unwritable_folder_is_a_clear_error():
    with pytest.raises(OutputError, match="/proc/self/elevon"):
        write_text("/proc/self/elevon", "x")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_a_full_disk_is_a_clear_error(tmp_path):
    with pytest.raises(OutputError, match="No space left"), atomic_path(tmp_path / "a") as path:
        path.unlink()
        path.symlink_to("/dev/full")
        with path.open("wb") as stream:
            stream.write(b"x" * 100_000)


def test_kill_9_in_the_middle_leaves_no_half_file(tmp_path):
    """Killed while writing, with an old file in place and without one."""
    kept = write_text(tmp_path / "kept.txt", "old")
    program = textwrap.dedent(
        """
        import sys, time
        from elevon.files import atomic_path
        with atomic_path(sys.argv[1], force=True) as path, path.open("w") as stream:
            stream.write("half"); stream.flush()
            print("writing", flush=True)
            time.sleep(60)
        """
    )
    for target in (kept, tmp_path / "fresh.txt"):
        process = subprocess.Popen(
            [sys.executable, "-c", program, str(target)], stdout=subprocess.PIPE
        )
        with process:
            assert process.stdout.readline() == b"writing\n"
            process.send_signal(signal.SIGKILL)
    assert kept.read_text() == "old"
    assert not (tmp_path / "fresh.txt").exists()
    assert all(name.startswith(".") for name in set(_names(tmp_path)) - {"kept.txt"})
