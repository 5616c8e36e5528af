"""`actionkit call`: send one goal and wait until it has ended."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import (
    HELP,
    SECONDS,
    complete_types,
    debug_option,
    json_option,
    name_argument,
)
from actionkit.cli._shared.problems import Problem, import_ros, open_survey
from actionkit.cli._shared.say import wrapped
from actionkit.cli._shared.stdout import keep_clean
from actionkit.cli._shared.wording import in_options

if TYPE_CHECKING:
    from actionkit._messages.progress import Field
    from actionkit.cli.call._reports import Report

_F = TypeVar("_F", bound=Callable[..., Any])
_EPILOG = """\b
Examples:
  actionkit call /fibonacci test_msgs/action/Fibonacci '{order: 5}' --feedback
  actionkit call /fibonacci '{order: 5}' --timeout 10 --json
  echo '{"order": 5}' | actionkit call fibonacci test_msgs/Fibonacci --stdin
  actionkit call /navigate nav2_msgs/action/NavigateToPose --progress distance_remaining \\
      '{pose: {header: {stamp: now, frame_id: map}, pose: {position: {x: 1.5}}}}'

Ctrl-C cancels the goal on the server and says what happened to it; twice leaves at once."""


class _WithExitCodes(click.Command):
    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_epilog(ctx, formatter)
        formatter.write("\n  Exit codes:\n")
        for code in Exit:
            meaning = wrapped(code.meaning, 9, columns=formatter.width)
            formatter.write(f"    {code.value:>3}  {meaning}\n")


def _timeout(name: str, words: str, default: float | None) -> Callable[[_F], _F]:
    """Return a decorator that adds the option for one of the `Timeouts`."""
    option = f"--{name}-timeout"
    return click.option(option, type=SECONDS, default=default, show_default=True, help=words)


@click.command("call", cls=_WithExitCodes, context_settings=HELP, epilog=_EPILOG)
@name_argument
@click.argument("type_name", metavar="[TYPE]", required=False, shell_complete=complete_types)
@click.argument("words", metavar="[GOAL]", nargs=-1)
@click.option("-f", "--feedback", is_flag=True, help="Show each feedback message.")
@click.option("--stdin", is_flag=True, help="Read the goal from standard input.")
@click.option(
    "--timeout",
    type=SECONDS,
    help="For everything: the server, acceptance, execution, retries. When they run out, the"
    " goal is cancelled. Without it: no limit.",
)
@_timeout("server", "Until a server is seen.", 5.0)
@_timeout("accept", "Until the server accepts or rejects the goal.", 5.0)
@_timeout("result", "Until the result of a goal that has ended comes, without --timeout.", 30.0)
@_timeout("feedback", "The longest silence between two feedback messages.", None)
@_timeout("cancel", "For a cancellation to be confirmed.", 2.0)
@click.option(
    "--retries",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="Try again up to N times after a failure that may pass; never while an earlier goal may"
    " still be running.",
)
@click.option(
    "--ok",
    metavar="PATH=VALUE,..",
    help="Take a result for a success only where this field has one of the values.",
)
@click.option(
    "--transient",
    metavar="PATH=VALUE,..",
    help="Take one for a failure that may pass where this field has one of the values.",
)
@click.option(
    "--progress",
    metavar="PATH[:HOW]",
    help="The field of the feedback that tells how far the goal is. HOW is percent, share,"
    " remaining, or the number that it counts up to; an array counts by its length. Without it:"
    " a field that has such a name.",
)
@json_option("Write one JSON object on each line.")
@debug_option
def command(
    name: str,
    type_name: str | None,
    words: tuple[str, ...],
    feedback: bool,
    stdin: bool,
    timeout: float | None,
    retries: int,
    ok: str | None,
    transient: str | None,
    progress: str | None,
    as_json: bool,
    **timeouts: Any,  # fields of `Timeouts`: name every other option above
) -> int:
    """Send a goal to the action NAME and wait for its result.

    TYPE is the action's type, such as test_msgs/action/Fibonacci; without it, the type of the
    server that is in sight. GOAL is YAML or JSON; fields that are missing keep their defaults, and
    `now` stands for the present time in a stamp or a header. Words and flags are those of
    `ros2 action send_goal`, which is another name of this: `actionkit send_goal`.
    """
    from actionkit.cli.call import _arguments, _goals

    type_name, goal = _arguments.told_apart(name, type_name, words, stdin)
    keep_clean()
    import_ros()
    with contextlib.ExitStack() as until_made:
        if type_name is None:
            # Open until the client is made: so the client sees the same servers at once.
            survey = until_made.enter_context(open_survey())
            patience, limit = timeouts["server_timeout"], "--server-timeout"
            if timeout is not None and timeout < patience:
                patience, limit = timeout, "--timeout"
            type_name = _arguments.served_type(survey, name, patience, limit)
            if timeout is not None:
                timeout = max(0.0, timeout - (time.monotonic() - survey.opened))
        action = _arguments.action_class(type_name)
        text = _read_goal() if stdin else "{}" if goal is None else goal
        message = _goals.parse(text, action.Goal)
        classify = _classifier(ok, transient, action.Result)
        field = _progress_field(progress, action.Feedback)

        from actionkit import Client, RetryPolicy, Timeouts

        limits = {key.removesuffix("_timeout"): value for key, value in timeouts.items()}
        try:
            client: Any = Client(
                action,
                name,
                timeouts=Timeouts(**limits),
                retry=RetryPolicy(attempts=retries + 1),
                classify=classify,
            )
        except ImportError as error:  # such as another version of rclpy
            raise Problem(Exit.NO_ROS, str(error)) from error
        except ValueError as error:
            raise click.UsageError(in_options(str(error))) from error

    from actionkit._internal_api import mute
    from actionkit._messages.progress import Progress
    from actionkit._model.action_type import type_name_of
    from actionkit.cli.call._calling import Calling
    from actionkit.cli.call._reports import JsonReport

    mute()  # the report already says what happened to the goal

    calling = Calling(
        client,
        JsonReport(message, client.action_name, type_name_of(action))
        if as_json
        else _report(message, bar=field is not None),
        echo=feedback,
        progress=None if field is None else Progress(field),
    )
    return calling.run(
        lambda on_feedback: client.call_async(message, on_feedback=on_feedback, timeout=timeout)
    )


def _read_goal() -> str:
    from actionkit.cli.call._goals import MOST_TEXT

    try:
        return sys.stdin.read(MOST_TEXT + 1)  # the writer may never end
    except UnicodeDecodeError as error:
        raise click.BadParameter(
            f"standard input is no text ({error}). Nothing was sent.", param_hint="GOAL"
        ) from error


def _report(goal: Any, *, bar: bool) -> Report:
    from actionkit.cli.call._reports import TextReport

    if sys.stdout.isatty():
        from actionkit.cli.call._live import LiveReport

        return LiveReport(goal, bar=bar)
    return TextReport(goal)


def _progress_field(text: str | None, feedback_class: type) -> Field | None:
    from actionkit._messages.progress import chosen, found

    if text is None:
        return found(feedback_class)
    try:
        return chosen(text, feedback_class)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--progress") from error


def _classifier(ok: str | None, transient: str | None, result_class: type) -> Any:
    if ok is None and transient is None:
        return None
    from actionkit import classify_by_field

    paths, values = {}, {}
    for option, text in (("ok", ok), ("transient", transient)):
        if text is not None:
            paths[option], values[option] = _condition(f"--{option}", text)
    if len(set(paths.values())) > 1:
        raise click.UsageError("--ok and --transient must be about the same field.")
    try:
        classifier = classify_by_field(next(iter(paths.values())), **values)
        classifier.check(result_class)
    except ValueError as error:
        raise click.UsageError(in_options(str(error))) from error
    return classifier


def _condition(option: str, text: str) -> tuple[str, set[Any]]:
    path, equals, values = text.partition("=")
    if not (path and equals and values):
        raise click.BadParameter(
            f"{text!r} is not of the form error_code=0 or error_code=101,102", param_hint=option
        )
    return path, {_value(value) for value in values.split(",")}


def _value(text: str) -> Any:
    """Return the value of a number, `true` or `false`; all else is a string."""
    try:
        value = json.loads(text)
    except ValueError:
        return text
    return value if isinstance(value, (bool, int, float, str)) else text
