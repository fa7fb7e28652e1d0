"""Results appear whole or not at all."""

import errno
import os
from pathlib import Path

import pytest

from qualrl.errors import OutputError
from qualrl.io.output_folder import OutputFolder


def listing(folder: Path) -> dict[str, str]:
    """Every file below a folder and what it holds; so nothing hidden is left behind either."""
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_a_new_folder_appears_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "results"
    with OutputFolder(target) as folder:
        folder.path("a.txt").write_text("a")
        folder.path("b.txt").write_text("b")
        assert not target.exists()
    assert listing(tmp_path) == {"results/a.txt": "a", "results/b.txt": "b"}


def test_an_existing_folder_keeps_its_other_files(tmp_path: Path) -> None:
    target = tmp_path / "r"
    target.mkdir()
    (target / "old.txt").write_text("old")
    (target / "a.txt").write_text("before")
    with OutputFolder(target) as folder:
        folder.path("a.txt").write_text("after")
        assert (target / "a.txt").read_text() == "before"
    assert listing(tmp_path) == {"r/old.txt": "old", "r/a.txt": "after"}


def test_a_relative_folder_and_the_current_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for name in (".", "sub"):
        with OutputFolder(name) as folder:
            folder.path("a.txt").write_text(name)
    assert listing(tmp_path) == {"here/a.txt": ".", "here/sub/a.txt": "sub"}


def test_missing_parents_are_made(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "x" / "y" / "z") as folder:
        folder.path("a").write_text("1")
    assert listing(tmp_path) == {"x/y/z/a": "1"}


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt, SystemExit, OutputError])
@pytest.mark.parametrize("existed", [False, True])
def test_after_any_exception_nothing_has_changed(tmp_path: Path, failure: type[BaseException], existed: bool) -> None:
    target = tmp_path / "new" / "results"
    if existed:
        target.mkdir(parents=True)
        (target / "a.txt").write_text("before")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(failure), OutputFolder(target) as folder:  # noqa: PT012
        folder.path("a.txt").write_text("half")
        raise failure
    assert sorted(tmp_path.rglob("*")) == before
    assert listing(tmp_path) == ({"new/results/a.txt": "before"} if existed else {})


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "../a", "/a", "a\\b", "nul\0"])
def test_names_cannot_leave_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match="not a plain file name"), OutputFolder(tmp_path / "r") as folder:
        folder.path(name)
    assert listing(tmp_path) == {}


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for target in (tmp_path / "file", tmp_path / "file" / "sub", tmp_path / "file" / "sub" / "sub"):
        with pytest.raises(OutputError) as caught, OutputFolder(target):
            pass
        assert str(caught.value).startswith(f"{target}: ")
        assert "\n" not in str(caught.value)
    assert listing(tmp_path) == {"file": "x"}


@pytest.mark.parametrize("name", ["nul\0", "x" * 300])
def test_names_that_no_file_system_takes(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match="cannot be written"), OutputFolder(tmp_path / name / "r"):
        pass
    assert listing(tmp_path) == {}


def test_a_folder_where_a_result_would_go_stops_all_replacing(tmp_path: Path) -> None:
    (tmp_path / "r" / "b.txt").mkdir(parents=True)
    said = r"holds a folder 'b\.txt' where a result would go"
    with pytest.raises(OutputError, match=said), OutputFolder(tmp_path / "r") as folder:  # noqa: PT012
        folder.path("a.txt").write_text("a")
        folder.path("b.txt").write_text("b")
    assert listing(tmp_path) == {}


def test_a_folder_that_may_not_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everywhere
    with pytest.raises(OutputError, match=r"cannot be written \(permission denied\)"), OutputFolder(tmp_path):
        pass


def test_a_full_disk_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="make room on the disk"), OutputFolder(tmp_path / "r"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert listing(tmp_path) == {}


def test_two_runs_into_the_same_new_folder_both_arrive(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "r") as one, OutputFolder(tmp_path / "r") as two:
        one.path("a").write_text("1")
        two.path("b").write_text("2")
    assert listing(tmp_path) == {"r/a": "1", "r/b": "2"}


def test_results_have_ordinary_permissions(tmp_path: Path) -> None:
    mask = os.umask(0o022)
    try:
        with OutputFolder(tmp_path / "r") as folder:
            folder.path("a").write_text("a")
    finally:
        os.umask(mask)
    modes = [(tmp_path / name).stat().st_mode & 0o777 for name in ("r", "r/a")]
    assert modes == [0o755, 0o644]


def test_a_file_in_the_way_above_the_folder_is_named(tmp_path):
    (tmp_path / "taken").write_text("mine")
    with (
        pytest.raises(OutputError, match=r"cannot be written \(taken is a file\); name another place"),
        OutputFolder(tmp_path / "taken" / "a" / "b"),
    ):
        pass
    assert (tmp_path / "taken").read_text() == "mine"
