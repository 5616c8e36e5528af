"""What the benchmarks make of their samples. What they measure is run by hand."""

from __future__ import annotations

import os
import threading

import pytest

measure = pytest.importorskip("benchmarks.measure", reason="not in an installed package")

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
    report.write_docs([one], page, "the command")
    text = page.read_text()
    assert text.startswith("above\n")
    assert text.endswith("\nbelow\n")
    assert "old" not in text
    assert f"| 1 | cost | {measured:.3g} x | <= 0.6 x | {'met' if met else 'missed'} |" in text


def test_results_are_read_back_as_they_were(tmp_path):
    written = measure.Report(
        3,
        "Many",
        figures=[measure.Figure("cpu", "ours", 1.0, "ms", "theirs", 0.5, 0.4, 0.6)],
        verdicts=[measure.Verdict("cost", 0.5, 0.6)],
    )
    report.write_json([written], tmp_path / "results.json", "the command")
    assert report.read_json(tmp_path / "results.json") == {3: written}
    assert report.read_json(tmp_path / "none.json") == {}


def test_what_is_not_measured_is_no_success():
    assert not measure.Verdict("cost", None, 0.6).met


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
