"""Spans and metrics of real calls, in the SDK's own in-memory exporters (contract C6.2)."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest
from opentelemetry.sdk.metrics import MeterProvider
from opentelemetry.sdk.metrics.export import InMemoryMetricReader
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.trace import StatusCode

import actionkit as ak
from actionkit import OpenTelemetry, RetryPolicy, Timeouts, Verdict

QUICK = RetryPolicy(initial=0.05, jitter=0.0)


class Telemetry:
    """The observer, and what it sent."""

    def __init__(self):
        self._spans = InMemorySpanExporter()
        self._metrics = InMemoryMetricReader()
        self.traces = TracerProvider()
        self.traces.add_span_processor(SimpleSpanProcessor(self._spans))
        self.meters = MeterProvider([self._metrics])
        self.observer = OpenTelemetry(self.traces, self.meters)

    def spans(self, prefix):
        found = [s for s in self._spans.get_finished_spans() if s.name.startswith(prefix)]
        return sorted(found, key=lambda span: span.start_time)

    def metrics(self, name):
        """Return the points of a metric by the attribute in which they differ."""
        points = {}
        for resource in self._metrics.get_metrics_data().resource_metrics:
            for scope in resource.scope_metrics:
                assert scope.scope.name == "actionkit"
                for metric in scope.metrics:
                    if metric.name == name:
                        points.update(
                            (self._key(point.attributes), point)
                            for point in metric.data.data_points
                        )
        return points

    @staticmethod
    def _key(attributes):
        assert attributes["actionkit.action_name"] == "/fibonacci"
        assert attributes["actionkit.action_type"] == "test_msgs/action/Fibonacci"
        return attributes.get("actionkit.phase") or attributes.get("actionkit.outcome", "")


@pytest.fixture
def telemetry():
    made = Telemetry()
    yield made
    made.traces.shutdown()
    made.meters.shutdown()


def names(span):
    return [event.name for event in span.events]


def test_a_call_is_a_span_with_a_child_for_its_attempt(action_server, make_client, telemetry):
    action_server("fibonacci", period=0.05)
    client = make_client(observers=[telemetry.observer])
    with telemetry.traces.get_tracer("mine").start_as_current_span("mission") as mission:
        future = client.call_async({"order": 3}, timeout=20)
        outcome = future.outcome(20)
    client.close()
    (call,) = telemetry.spans("call")
    (attempt,) = telemetry.spans("attempt")
    assert call.name == "call /fibonacci"
    assert call.parent.span_id == mission.get_span_context().span_id
    assert attempt.parent.span_id == call.get_span_context().span_id
    assert attempt.attributes["actionkit.goal_id"] == str(outcome.goal_id)
    assert call.attributes["actionkit.outcome"] == "ok"
    assert call.attributes["actionkit.attempts"] == 1
    assert call.status.status_code is StatusCode.UNSET
    assert names(attempt)[:3] == ["SENDING", "SENT", "ACCEPTED"]
    assert names(attempt)[-1] == "SUCCEEDED"
    assert names(attempt).count("FEEDBACK") == outcome.feedback_count
    assert (call.end_time - call.start_time) / 1e9 == pytest.approx(outcome.elapsed, abs=0.001)
    assert call.start_time <= attempt.start_time <= attempt.end_time <= call.end_time
    assert telemetry.metrics("actionkit.calls")["ok"].value == 1
    assert telemetry.metrics("actionkit.calls.in_flight")[""].value == 0
    phases = telemetry.metrics("actionkit.phase.duration")
    assert set(phases) == {"server", "accept", "execute"}
    told = outcome.timeline[-1].monotonic - outcome.timeline[0].monotonic
    assert sum(point.sum for point in phases.values()) == pytest.approx(told)
    assert telemetry.metrics("actionkit.call.duration")["ok"].sum == outcome.elapsed
    assert phases["accept"].explicit_bounds[0] == 0.001


@pytest.mark.long
def test_each_attempt_is_a_child(action_server, make_client, telemetry):
    action_server("aborts")
    client = make_client(
        observers=[telemetry.observer], retry=QUICK, classify=lambda outcome: Verdict.TRANSIENT
    )
    with pytest.raises(ak.GoalAbortedError):
        client.call({"order": 1}, timeout=20)
    client.close()
    (call,) = telemetry.spans("call")
    attempts = telemetry.spans("attempt")
    assert [span.name for span in attempts] == ["attempt 1", "attempt 2", "attempt 3"]
    assert {span.parent.span_id for span in attempts} == {call.get_span_context().span_id}
    assert call.parent is None
    assert [names(span)[-1] for span in attempts] == ["RETRYING", "RETRYING", "ABORTED"]
    assert call.status.status_code is StatusCode.ERROR
    assert "was aborted by the server" in call.status.description
    assert call.attributes["error.type"] == "GoalAbortedError"
    assert telemetry.metrics("actionkit.retries")[""].value == 2
    assert telemetry.metrics("actionkit.calls")["GoalAbortedError"].value == 1
    assert telemetry.metrics("actionkit.phase.duration")["pause"].count == 2


@pytest.mark.long
def test_calls_in_flight_and_calls_that_are_given_up(action_server, make_client, telemetry):
    server = action_server("fibonacci", period=0.05)
    client = make_client(observers=[telemetry.observer])
    futures = [client.call_async({"order": 90}) for _ in range(3)]
    server.wait_for("executing", count=3)
    for future in futures:
        next(iter(future.feedback()))
    client._session.dispatcher.flush(time.monotonic() + 10)
    assert telemetry.metrics("actionkit.calls.in_flight")[""].value == 3
    futures[0].cancel()
    futures[0].outcome(10)
    client.close()
    assert telemetry.metrics("actionkit.calls.in_flight")[""].value == 0
    calls = telemetry.metrics("actionkit.calls")
    assert {word: point.value for word, point in calls.items()} == {
        "cancelled": 1,
        "ClientClosedError": 2,
    }
    by_outcome = {s.attributes["actionkit.outcome"]: s for s in telemetry.spans("call")}
    assert by_outcome["cancelled"].status.status_code is StatusCode.UNSET
    assert by_outcome["ClientClosedError"].attributes["actionkit.cancel"] == "CONFIRMED"
    assert telemetry.observer._open == {}


def test_calls_that_sent_nothing_have_a_span(make_client, telemetry):
    client = make_client(
        observers=[telemetry.observer], timeouts=Timeouts(server=0.1), retry=RetryPolicy.none()
    )
    for goal in ({"order": "x"}, {"order": 1}):
        with pytest.raises(ak.ActionKitError):
            client.call(goal)
    client.close()
    assert [span.attributes["actionkit.outcome"] for span in telemetry.spans("call")] == [
        "InvalidGoalError",
        "ServerUnavailableError",
    ]
    assert len(telemetry.spans("attempt")) == 1
    assert telemetry.metrics("actionkit.calls.in_flight")[""].value == 0
    assert telemetry.metrics("actionkit.phase.duration") == {}  # no server came


WITHOUT = """
import sys
sys.modules["opentelemetry"] = None
import actionkit
try:
    actionkit.OpenTelemetry()
except ImportError as error:
    print(error)
"""


def test_without_the_package_the_error_says_what_to_install():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, timeout=30, check=True
    )
    assert "pip install opentelemetry-api" in done.stdout
