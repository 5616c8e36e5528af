"""How the benchmarks evaluate their samples. The measurements are run by hand."""

from __future__ import annotations

import os
import threading
import time
from functools import partial

import pytest

measure = pytest.importorskip("benchmarks.measure", reason="not in an installed package")

from benchmarks import child as children  # noqa: E402
from benchmarks import climb as climbs  # noqa: E402
from benchmarks import process, report  # noqa: E402  after it is known to be there


def test_variants_have_their_turns_in_alternation():
    turns: list[str] = []
    names = ("a", "b", "c")
    variants = {name: lambda name=name: turns.append(name) or {"x": 1.0} for name in names}
    samples = measure.alternate(3, variants)
    assert "".join(turns) == "abccbaabc"
    assert {name: len(taken) for name, taken in samples.items()} == {"a": 3, "b": 3, "c": 3}


def test_a_ratio_is_the_median_of_the_rounds_own():
    # The machine is ten times slower in the second round, which falls on both alike.
    samples = {
        "ours": [{"x": 1.0}, {"x": 10.0}, {"x": 1.5}],
        "theirs": [{"x": 2.0}, {"x": 20.0}, {"x": 2.0}],
    }
    line = measure.figure("x", samples, "ours", "x", baseline="theirs")
    assert (line.ratio, line.value) == (0.5, 1500.0)
    assert (line.low, line.high) == (0.5, 0.625)
    assert measure.figure("x", samples, "theirs", "x", baseline="theirs").ratio is None
    assert measure.best(samples, ("ours", "theirs"), "x") == "ours"


@pytest.mark.parametrize(("measured", "met"), [(0.5, True), (0.6, True), (0.61, False)])
def test_a_target_is_met_or_missed(measured, met, tmp_path):
    verdict = measure.Verdict("cost", measured, 0.6)
    assert verdict.met is met
    page = tmp_path / "cost.md"
    page.write_text("above\n<!-- begin: benchmarks -->\nold\n<!-- end: benchmarks -->\nbelow\n")
    one = measure.Report(1, "One call", verdicts=[verdict])
    report.write_docs({1: one}, page)
    text = page.read_text()
    assert text.startswith("above\n")
    assert text.endswith("\nbelow\n")
    assert "old" not in text
    assert f"| cost | {measured:.3g} x | <= 0.6 x | {'met' if met else '**missed**'} |" in text


def test_results_are_read_back_as_they_were(tmp_path):
    written = measure.Report(
        3,
        "Many",
        figures=[measure.Figure("cpu", "ours", 1.0, "ms", "theirs", 0.5, 0.4, 0.6)],
        verdicts=[measure.Verdict("cost", 0.5, 0.6)],
        plots=[measure.Plot("cost", "goals", "ms", {"ours": [(1, 2.0), (10, 2.5)]})],
        notes=["theirs, 10 goals: no answer."],
        about="on a machine",
    )
    report.write_json({3: written}, tmp_path / "results.json")
    assert report.read_json(tmp_path / "results.json") == {3: written}
    assert report.read_json(tmp_path / "none.json") == {}


def test_what_is_not_measured_is_no_success():
    verdict = measure.Verdict("cost", None, 0.6)
    assert not verdict.met
    assert verdict.share > 1.0


def test_the_page_tells_how_many_targets_are_met(tmp_path):
    page = tmp_path / "cost.md"
    page.write_text("<!-- begin: targets -->\nold\n<!-- end: targets -->\n")
    verdicts = [measure.Verdict("CPU", 0.5, 0.6), measure.Verdict("time", 1.2, 1.0)]
    report.write_docs({1: measure.Report(1, "One call", verdicts=verdicts)}, page)
    text = page.read_text()
    assert "| 1 of 2 | time: 1.2 x (<= 1 x) |" in text


@pytest.fixture
def climbing():
    return measure.Report(9, "Scale")


def test_who_breaks_twice_at_a_size_is_not_tried_at_a_larger_one(climbing):
    tried: list[tuple[str, int]] = []

    def turn(who: str, most: int, size: int) -> dict[str, float]:
        tried.append((who, size))
        if size > most:
            raise RuntimeError("first line\nRuntimeError: no answer")
        return {"x": float(size)}

    climb = climbs.Climb(climbing, "goals", "goals", 60.0)
    turns = {"ours": partial(turn, "ours", 1000), "theirs": partial(turn, "theirs", 10)}
    climb.up((10, 100, 1000), turns, 1)
    assert tried.count(("theirs", 100)) == 2
    assert ("theirs", 1000) not in tried
    assert climbing.notes == ["theirs, 100 goals: no answer."] * 2
    climb.figures("time", "x", "theirs", unit="s")
    assert [(line.who, line.ratio) for line in climbing.figures] == [
        ("ours, 10 goals", 1.0),
        ("ours, 100 goals", None),
        ("ours, 1,000 goals", None),
        ("theirs, 10 goals", None),
    ]
    assert climb.last_ratio("ours", "theirs", "x") == (10, 1.0)


def test_when_the_time_is_over_nothing_larger_is_tried(climbing):
    climb = climbs.Climb(climbing, "goals", "goals", 0.0)
    climb.up((10, 100), {"ours": lambda size: pytest.fail("tried")}, 2)
    assert climbing.notes == ["ours, 10 goals: there was no time left to try."]
    assert climb.last_ratio("ours", "ours", "x") is None


def test_a_child_that_does_not_answer_in_time_is_given_up():
    # The answer to this would be an error, but nobody reads its commands for so long.
    child = children.Child(0, "timeit", "-n", "1", "import time; time.sleep(60)")
    child.patience = 0.05
    began = time.monotonic()
    with child, pytest.raises(RuntimeError, match=r"no answer from timeit .* in 0 s"):
        child.do("anything")
    # Nobody waits for it to leave in peace.
    assert time.monotonic() - began < 15.0


@pytest.mark.long
def test_the_pictures_are_drawn_of_what_was_measured(tmp_path):
    plots = pytest.importorskip("benchmarks.plot", reason="needs matplotlib")
    figures = [
        measure.Figure(what, who, value, "ms")
        for what in ("order 5: latency", "order 5: client CPU")
        for who, value in (("ActionKit blocking", 1.5), ("rclpy one thread", 2), ("tutorial", 110))
    ]
    one = measure.Report(1, "One call", figures=figures)
    plot = measure.Plot("cost", "goals", "ms", {"ours": [(0, 2.0), (10, 90.0)]})
    nine = measure.Report(9, "Scale", plots=[plot])
    plots.write({1: one, 9: nine}, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cost-call.svg", "cost-growth.svg"]
    drawn = (tmp_path / "cost-call.svg").read_text()
    assert "rclpy one thread" in drawn
    assert "110 (cut off)" in drawn  # or the others could not be told apart


def test_threads_are_told_apart_and_counted():
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        seen = process.threads(os.getpid())
        assert thread.native_id in seen
        assert process.cpu(os.getpid()) > 0
        assert process.resident(os.getpid()) > 1e6
    finally:
        done.set()
        thread.join()
