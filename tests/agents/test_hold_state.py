"""The state of holds, merged in any order. Contract C10.4."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from functools import reduce
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from actionkit._ros.holds import files, state
from actionkit._ros.holds import view as views
from actionkit._ros.holds.files import HoldFiles, UnreadableError
from actionkit._ros.holds.state import Hold, HoldState, Sender, decode, encode, merged
from actionkit._ros.holds.topic import HoldTopic, Speaker
from actionkit._ros.holds.view import HoldView

IDS = st.sampled_from([f"id{number}" for number in range(6)])
HOLDS = st.builds(Hold, st.floats(0, 1e9), IDS, st.sampled_from(["ann@a", "bob@b"]))
STATES = st.builds(
    lambda holds, released: HoldState({hold.hold_id: hold for hold in holds}, released),
    st.lists(HOLDS, max_size=4),
    st.dictionaries(IDS, st.integers(1, 9), max_size=4),
)
SENDER = Sender("actionkit_hold_1", "agent", "ann@a", 7)


def one(name: str = "1", since: float = 1.0, by: str = "ann@a") -> Hold:
    return Hold(since, name, by)


def of(*holds: Hold) -> HoldState:
    return HoldState({hold.hold_id: hold for hold in holds})


@given(STATES, STATES, STATES)
def test_the_order_in_which_things_are_heard_does_not_matter(
    a: HoldState, b: HoldState, c: HoldState
) -> None:
    assert merged(a, merged(b, c)) == merged(merged(a, b), c) == merged(c, a, b)
    assert merged(a, a) == merged(a)


@pytest.mark.long
@settings(max_examples=30)
@given(st.lists(STATES, max_size=5), st.randoms())
def test_that_holds_also_where_much_is_forgotten(many: list[HoldState], random: object) -> None:
    flood = [
        HoldState({}, {f"old{n}": n + 1 for n in range(begin, begin + 90)}) for begin in (0, 50)
    ]
    shuffled = [*flood, *many]
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    folded = reduce(merged, shuffled, HoldState())
    # A hold that was forgotten to have ended is one again, until the next release.
    assert folded.released == merged(*flood, *many).released
    assert set(merged(*flood, *many).holds) <= set(folded.holds)
    assert len(folded.released) <= state.MOST_RELEASED


@pytest.mark.long
@given(STATES)
def test_what_is_written_is_read(told: HoldState) -> None:
    assert decode(encode(told, SENDER)) == (merged(told), SENDER)
    assert decode(encode(told)) == (merged(told), None)


def test_others_learn_who_sends_and_what_holds() -> None:
    known = state.released(of(one("1"), one("2")), [one("2")])
    assert decode(encode(known, SENDER)) == (known, SENDER)
    assert decode(encode(known)) == (known, None)
    assert str(SENDER) == "agent of ann@a (process 7)"
    assert encode(known, SENDER) == (
        '{"actionkit_hold":1,"holds":[["1","ann@a",1.0]],"released":{"2":1},'
        '"from":["actionkit_hold_1","agent","ann@a",7]}'
    )


@pytest.mark.parametrize(
    "hold", [one("1", since=0.0), one("1", by="a" * 300), one("1" * 300)], ids=["0", "by", "id"]
)
@pytest.mark.every
def test_a_hold_at_the_limits_is_read(hold: Hold) -> None:
    assert decode(encode(of(hold))) == (of(hold), None)


def test_a_message_is_read_up_to_the_longest() -> None:
    longest = encode(of(one())).ljust(state.LONGEST)
    assert decode(longest) == (of(one()), None)
    assert decode(longest + " ")[0].active[0].by == state.UNREADABLE


def test_whether_it_tells_anything() -> None:
    assert not HoldState()
    assert of(one())
    assert HoldState({}, {"1": 1})


def test_a_release_ends_what_it_knows_of_and_nothing_else() -> None:
    ended = state.released(of(one("1"), one("2")), [one("1"), one("2")])
    assert not ended.active
    # Who was away still says so; a human's new stop, which nobody knows yet, is different.
    assert merged(ended, of(one("1"))).active == ()
    assert merged(of(one("3", since=0.0)), ended).active == (one("3", since=0.0),)


def test_very_many_holds_and_releases_leave_nothing_behind() -> None:
    known = HoldState()
    for number in range(500):
        hold = one(str(number))
        known = state.released(merged(known, of(hold)), [hold])
    assert not known.active
    assert len(known.released) == state.MOST_RELEASED
    assert len(encode(known)) < 5_000
    assert merged(known, of(one("499"))).active == ()
    # The newest of all can be released still, whoever comes back from long ago.
    late = merged(known, of(one("0")))
    assert state.released(late, late.active).active == ()


def test_a_releases_rank_is_bounded_and_still_a_release() -> None:
    highest = HoldState({}, {"x": 10**15})
    ended = state.released(merged(highest, of(one())), [one()])
    assert decode(encode(ended))[0].active == ()


@pytest.mark.long
@given(st.lists(st.floats(0, 1e9), min_size=1, max_size=5), st.randoms())
def test_keepers_of_one_human_leave_one_hold_whatever_their_clocks_said(
    clocks: list[float], random: object
) -> None:
    holds = [one(str(number), since) for number, since in enumerate(clocks)]
    known = of(*holds)
    random.shuffle(holds)  # type: ignore[attr-defined]
    said = [state.released(known, state.older_of_same(known, own)) for own in holds]
    assert len(merged(known, *said).active) == 1


def test_others_holds_are_left_to_them() -> None:
    own = one("1", 5.0)
    assert state.older_of_same(of(own, one("2", 1.0, by="bob@b")), own) == ()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "stop!",
        "[]",
        "{}",
        "[" * 100_000,
        json.dumps({"actionkit_hold": 2, "holds": [], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["1", "a", "now"]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["1", "a"]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["1", "a", float("nan")]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [], "released": {"1": True}}),
        json.dumps({"actionkit_hold": 1, "holds": [], "released": {"1": 10**16}}),
        json.dumps({"actionkit_hold": 1, "holds": [], "released": {"1": 0}}),
        json.dumps({"actionkit_hold": 1, "holds": [], "released": {}, "from": ["a"]}),
        json.dumps({"actionkit_hold": 1, "holds": [["1" * 400, "a", 1]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["", "a", 1]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["1", "a", True]], "released": {}}),
        json.dumps({"actionkit_hold": 1, "holds": [["1", "a", 1e11]], "released": {}}),
        '"\ud800"',
    ],
)
@pytest.mark.every
def test_what_cannot_be_read_is_a_hold_that_can_be_released(text: str) -> None:
    told, sender = decode(text)
    assert sender is None
    (hold,) = told.active
    assert hold.by == state.UNREADABLE
    assert decode(text) == (told, None)
    assert decode(encode(told)) == (told, None)  # so it is passed on
    assert merged(state.released(told, [hold]), decode(text)[0]).active == ()


def test_each_text_that_cannot_be_read_is_a_hold_of_its_own_and_the_same_for_everybody() -> None:
    told = decode("stop!")[0]
    assert told == of(Hold(0.0, "unreadable-c7a3f8faaedb6cec", state.UNREADABLE))
    other = decode("stop?")[0]
    assert merged(state.released(told, told.active), other).active == other.active


# --- the files of one computer -----------------------------------------------------------------


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path / "holds"))
    return tmp_path / "holds"


def test_a_file_tells_others_at_once_and_is_never_undone(directory: Path) -> None:
    writer, reader = HoldFiles(7), HoldFiles(7)
    assert reader.read() == HoldState()
    writer.write(HoldState())
    assert not directory.exists()
    writer.write(of(one("1")))
    assert reader.read().active == (one("1"),)
    assert HoldFiles(8).read() == HoldState()
    assert stat.S_IMODE(directory.stat().st_mode) == 0o1777
    # Two processes that know different things do not undo each other's.
    reader.write(of(one("2")))
    assert {hold.hold_id for hold in writer.read().active} == {"1", "2"}
    writer.write(state.released(reader.read(), reader.read().active))
    assert reader.read().active == ()
    assert len(list(directory.iterdir())) == 1
    (file,) = directory.iterdir()
    before = file.stat()
    reader.write(of(one("1")))
    assert file.stat() == before, "written although it told that already"


def test_of_two_users_each_has_a_file(directory: Path) -> None:
    HoldFiles(7).write(of(one("1")))
    (ours,) = directory.iterdir()
    prefix = ours.name.rpartition("-")[0]
    # Of a rootless container: its users have other numbers than the same users here.
    (directory / f"{prefix}-0.4026532207").write_text(encode(of(one("2"))))
    if os.getuid() == 0:
        os.chown(directory / f"{prefix}-0.4026532207", 4711, 4711)
    assert HoldFiles(7).read().active == (one("1"), one("2"))


def test_a_rootless_container_writes_a_file_of_its_own(directory: Path) -> None:
    """There, the number 0 is that of an ordinary user, who cannot replace the file of root."""
    script = (
        "from actionkit._ros.holds.files import HoldFiles; from tests.agents.test_hold_state import"
        " of, one; HoldFiles(7).write(of(one('2'))); print(HoldFiles(7).shared_by())"
    )
    apart = ("unshare", "--user", "--map-root-user")
    if subprocess.run([*apart, "true"], check=False, capture_output=True).returncode:
        pytest.skip("this computer lets nobody make a user namespace")
    HoldFiles(7).write(of(one("1")))
    told = subprocess.run(
        [*apart, sys.executable, "-c", script], check=True, capture_output=True, text=True
    )
    assert len(list(directory.iterdir())) == 2
    assert HoldFiles(7).read().active == (one("1"), one("2"))
    assert told.stdout.strip() == HoldFiles(7).shared_by()


def test_who_has_other_files_is_told_apart(
    directory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = HoldFiles(7).shared_by()
    assert here == HoldFiles(8).shared_by()
    assert here.replace("_", "").isalnum()
    monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path / "other"))
    assert here != HoldFiles(7).shared_by()
    # Nobody shares what cannot be written.
    (tmp_path / "file").touch()
    monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path / "file"))
    assert HoldFiles(7).shared_by() != HoldFiles(7).shared_by()


def test_a_file_that_cannot_be_read_is_no_file_that_tells_nothing(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    HoldFiles(7).write(of(one("1")))
    (file,) = directory.iterdir()
    file.write_text("{")
    (hold,) = HoldFiles(7).read().active
    assert hold.by == state.UNREADABLE

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    reader = HoldFiles(7)
    monkeypatch.setattr(files.os, "open", refuse)
    with pytest.raises(UnreadableError, match="Permission denied"):
        reader.read()
    view = HoldView(7, "agent", speaks=False)
    view._settled, view._looked = True, views._uptime()  # it has heard all others
    assert "Permission denied" in view.known()[1]
    monkeypatch.undo()
    assert view.known()[1] == ""


@pytest.mark.parametrize("shares_files", [True, False])
def test_who_is_in_sight_and_has_not_been_heard_may_know_of_a_hold(shares_files: bool) -> None:
    view = HoldView(7, "agent", speaks=False)
    own, other = Speaker("own", b"1", True), Speaker("other", b"2", shares_files)
    assert not view._who_is_silent([own], "own", 0.0)
    assert view._who_is_silent([own, other], "own", 0.0)
    # One with the same files has written it into one; who has others may never be heard.
    assert view._who_is_silent([own, other], "own", views._FILES_DO) is not shares_files
    view._heard["other"] = views.Said(SENDER, HoldState(), 0.0)
    assert not view._who_is_silent([own, other], "own", 99.0)


def test_a_message_that_was_not_read_yet_may_be_a_hold(directory: Path) -> None:
    view = HoldView(7, "agent", speaks=False)
    view._settled, view._looked = True, views._uptime()  # it has heard all others
    assert view.surely_free
    view._on_text(encode(HoldState()))
    assert not view.surely_free
    assert view.known() == (HoldState(), "")
    assert view.surely_free


def test_a_message_that_is_none_of_the_middlewares_may_be_a_hold() -> None:
    topic: Any = HoldTopic.__new__(HoldTopic)
    told: list[str] = []
    topic._source = SimpleNamespace(take=lambda: [b"no message"])
    topic._on_text = told.append
    topic._take()
    (text,) = told
    assert decode(text)[0].active[0].by == state.UNREADABLE


@pytest.mark.every
@pytest.mark.parametrize("kind", ["symlink", "folder", "pipe"])
def test_what_is_in_the_place_of_a_file_may_be_a_hold(
    kind: str, directory: Path, tmp_path: Path
) -> None:
    HoldFiles(7).write(of(one("1")))
    (file,) = directory.iterdir()
    file.unlink()
    if kind == "symlink":
        (tmp_path / "other").write_text(encode(HoldState()))
        file.symlink_to(tmp_path / "other")
    elif kind == "folder":
        file.mkdir()
    else:
        os.mkfifo(file)
    for use in (HoldFiles(7).read, lambda: HoldFiles(7).write(of(one("2")))):
        with pytest.raises(UnreadableError, match="is not a regular file: remove it"):
            use()
    assert not stat.S_ISREG(file.lstat().st_mode)
    assert HoldFiles(8).read() == HoldState()
    directory.joinpath("domain-7").mkdir()
    assert HoldFiles(8).read() == HoldState()


def test_a_link_in_the_place_of_the_directory_hides_no_hold(
    directory: Path, tmp_path: Path
) -> None:
    directory.symlink_to(tmp_path / "nowhere")
    with pytest.raises(UnreadableError, match="is a symbolic link: remove it"):
        HoldFiles(7).read()
    with pytest.raises(NotADirectoryError):
        HoldFiles(7).write(of(one("1")))


def test_a_hold_does_not_outlive_a_start_of_the_computer(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    HoldFiles(7).write(of(one("1")))
    monkeypatch.setattr(files, "_boot", lambda: "another")
    assert HoldFiles(7).read() == HoldState()
