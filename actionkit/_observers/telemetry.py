"""Traces and metrics of every call, for OpenTelemetry (the extra `otel`)."""

from __future__ import annotations

import threading
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._observers.protocol import CallInfo
from actionkit._observers.words import outcome_word

if TYPE_CHECKING:
    from opentelemetry.metrics import MeterProvider
    from opentelemetry.trace import Span, TracerProvider

_PHASE_AFTER = {
    GoalState.SENDING: "server",
    GoalState.SENT: "accept",
    GoalState.ACCEPTED: "execute",
    GoalState.RETRYING: "pause",
}
"""Event -> the phase that begins with it, as in `DeadlineExceededError.phase`."""
_PHASE_ENDS = {
    "server": {GoalState.SENT},
    "accept": {GoalState.ACCEPTED, GoalState.REJECTED},
    "execute": {GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED, GoalState.LOST},
    "pause": {GoalState.SENDING},
}
"""The events that end a phase. A phase that ends in another way is not measured."""

_BUCKETS = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]
"""Seconds, for short acceptances and long missions. OpenTelemetry's defaults are for ms."""


@dataclass
class _Open:
    """A call that has not ended."""

    span: Span
    attributes: dict[str, str]
    attempt: Span | None = None
    number: int = 0
    phases: dict[str, float] = field(default_factory=dict)


class OpenTelemetry:
    """An observer that makes spans and metrics of every call.

    Each call has a span, which is a child of the caller's span. Each attempt has a span below that,
    and transitions are events on this span. Metrics: `actionkit.calls` by outcome,
    `actionkit.call.duration` and `actionkit.phase.duration` in seconds, `actionkit.retries`,
    `actionkit.calls.in_flight`.
    """

    def __init__(
        self,
        tracer_provider: TracerProvider | None = None,
        meter_provider: MeterProvider | None = None,
    ) -> None:
        """Make the instruments.

        Args:
            tracer_provider: Where spans go; `None` means OpenTelemetry's global provider.
            meter_provider: Where metrics go; `None` means OpenTelemetry's global provider.

        Raises:
            ImportError: OpenTelemetry is not installed.
            TypeError: An argument is not a provider.
        """
        for name, provider, makes in (
            ("tracer_provider", tracer_provider, "get_tracer"),
            ("meter_provider", meter_provider, "get_meter"),
        ):
            if provider is not None and not callable(getattr(provider, makes, None)):
                raise TypeError(f"OpenTelemetry: {name}={provider!r} must have {makes}()")
        try:
            from opentelemetry import context, metrics, trace
        except ImportError as error:
            raise ImportError(
                f"the observer OpenTelemetry needs opentelemetry-api ({error}):"
                " pip install opentelemetry-api"
            ) from error
        self._trace: Any = trace
        self._context: Any = context
        self._tracer = trace.get_tracer("actionkit", tracer_provider=tracer_provider)
        meter = metrics.get_meter("actionkit", meter_provider=meter_provider)
        self._calls = meter.create_counter(
            "actionkit.calls", "{call}", "Calls that ended, by outcome"
        )
        self._duration = meter.create_histogram(
            "actionkit.call.duration",
            "s",
            "From the call to its end",
            explicit_bucket_boundaries_advisory=_BUCKETS,
        )
        self._phase = meter.create_histogram(
            "actionkit.phase.duration",
            "s",
            "How long a phase of an attempt took",
            explicit_bucket_boundaries_advisory=_BUCKETS,
        )
        self._retries = meter.create_counter(
            "actionkit.retries", "{retry}", "Attempts after the first"
        )
        self._in_flight = meter.create_up_down_counter(
            "actionkit.calls.in_flight", "{call}", "Calls that have not ended"
        )
        self._lock = threading.Lock()
        self._open: dict[uuid.UUID, _Open] = {}

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Record a transition."""
        with self._lock:
            known = self._open.get(call.call_id)
            if known is None:
                if event.state is not GoalState.SENDING or event.attempt != 1:
                    return  # the call of this goal is over
                known = self._open[call.call_id] = self._begin(call)
                self._in_flight.add(1, known.attributes)
        if event.state is GoalState.SENDING and event.attempt != known.number:
            self._begin_attempt(known, event)
        if not event.cancel_refused:  # otherwise the goal was in this state before
            self._measure(known, event)
        span = known.attempt or known.span
        attributes: dict[str, str | int] = {"actionkit.goal_id": str(event.goal_id)}
        if event.detail:
            attributes["actionkit.detail"] = event.detail
        if event.cancel_refused:
            attributes["actionkit.cancel_refused"] = True
        span.add_event(event.state.value, attributes, _nanoseconds(event.wall))
        if event.state is GoalState.RETRYING:
            self._retries.add(1, known.attributes)
            self._end_attempt(known, event.wall)

    def on_outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Record the end of a call."""
        ended, word = call.wall + outcome.elapsed, outcome_word(outcome)
        with self._lock:
            known = self._open.pop(call.call_id, None)
        if known is None:
            known = self._begin(call)  # it had no event: an invalid goal, or cancelled at once
        else:
            self._in_flight.add(-1, known.attributes)
        self._end_attempt(known, ended)
        span = known.span
        span.set_attribute("actionkit.outcome", word)
        span.set_attribute("actionkit.state", outcome.status.value)
        span.set_attribute("actionkit.attempts", outcome.attempts)
        if outcome.cancel is not None:
            span.set_attribute("actionkit.cancel", outcome.cancel.value)
        if outcome.error is not None and word != "cancelled":
            span.set_attribute("error.type", word)
            span.set_status(self._trace.StatusCode.ERROR, str(outcome.error))
        span.end(_nanoseconds(ended))
        attributes = {**known.attributes, "actionkit.outcome": word}
        self._calls.add(1, attributes)
        self._duration.record(outcome.elapsed, attributes)

    def _begin(self, call: CallInfo) -> _Open:
        attributes = {
            "actionkit.action_name": call.action_name,
            "actionkit.action_type": call.action_type,
        }
        if call.node_name:
            attributes["actionkit.node_name"] = call.node_name
        parent = None
        if call.context is not None:
            # A copy, because only one thread at a time can enter a context.
            parent = call.context.copy().run(self._context.get_current)
        span = self._tracer.start_span(
            f"call {call.action_name}",
            parent,
            kind=self._trace.SpanKind.CLIENT,
            attributes={**attributes, "actionkit.call_id": str(call.call_id)},
            start_time=_nanoseconds(call.wall),
        )
        return _Open(span, attributes)

    def _begin_attempt(self, known: _Open, event: GoalEvent) -> None:
        self._end_attempt(known, event.wall)
        known.number = event.attempt
        known.attempt = self._tracer.start_span(
            f"attempt {event.attempt}",
            self._trace.set_span_in_context(known.span),
            attributes={
                "actionkit.goal_id": str(event.goal_id),
                "actionkit.attempt": event.attempt,
            },
            start_time=_nanoseconds(event.wall),
        )

    def _end_attempt(self, known: _Open, wall: float) -> None:
        if known.attempt is not None:
            known.attempt.end(_nanoseconds(wall))
            known.attempt = None

    def _measure(self, known: _Open, event: GoalEvent) -> None:
        for phase, since in list(known.phases.items()):
            if event.state in _PHASE_ENDS[phase]:
                del known.phases[phase]
                attributes = {**known.attributes, "actionkit.phase": phase}
                self._phase.record(event.monotonic - since, attributes)
        if event.state is GoalState.RETRYING:
            known.phases.clear()
        if event.state in _PHASE_AFTER:
            known.phases[_PHASE_AFTER[event.state]] = event.monotonic


def _nanoseconds(wall: float) -> int:
    return int(wall * 1_000_000_000)
