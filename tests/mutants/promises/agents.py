"""Mutants of a robot's tools for language models, and of a human's stop."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C10.1",
        "a call that is given up lets its goal run",
        "agents/_goal_call.py",
        '            record.cancel("its caller gave up")\n',
        "",
        ("agents/test_toolbox_given_up.py::test_cancelling_the_task_cancels_the_goal_and_waits",),
    ),
    Mutant(
        "C10.1",
        "a goal that is stopped while it is handed over runs",
        "agents/_goals.py",
        "        if self.why_cancelled:\n            future.cancel()\n",
        "",
        (
            "agents/test_agents_results.py::"
            "test_what_is_stopped_while_its_goal_is_handed_over_is_cancelled",
        ),
    ),
    Mutant(
        "C10.1",
        "a call that is given up does not wait for the confirmation",
        "agents/_goal_call.py",
        "                    await record.over(client.timeouts.cancel + _CANCEL_GRACE)\n",
        "                    pass\n",
        ("agents/test_toolbox_given_up.py::test_cancelling_the_task_cancels_the_goal_and_waits",),
    ),
    Mutant(
        "C10.1",
        "a goal that may run does not keep the model from trying again",
        "agents/_results.py",
        "retry and not may_run, ",
        "retry, ",
        ("agents/test_agents_results.py::test_what_may_run_is_not_to_be_tried_again",),
    ),
    Mutant(
        "C10.1",
        "an earlier goal that may run is not told of",
        "agents/_results.py",
        "    return any(goal.fate.may_run for goal in outcome.goals)\n",
        "    return outcome.goals[-1:] != () and outcome.goals[-1].fate.may_run\n",
        (
            "agents/test_agents_results.py::"
            "test_an_earlier_goal_that_may_run_is_told_of_where_the_last_one_has_ended",
        ),
    ),
    Mutant(
        "C10.1",
        "a goal that may run counts no more when its call is over",
        "agents/_goals.py",
        "        return self.value is None or self._goals is None or not self._goals.gone\n",
        "        return self.value is None\n",
        ("agents/test_toolbox.py::test_a_goal_that_cannot_be_cancelled_is_not_sent_beside",),
    ),
    Mutant(
        "C10.2",
        "the smallest number of the configuration is no limit",
        "agents/_goal_model.py",
        "            low = bounds[0] if own.minimum is None else max(bounds[0], own.minimum)\n",
        "            low = bounds[0]\n",
        ("agents/test_agents_arguments.py::test_values_outside_of_limits",),
    ),
    Mutant(
        "C10.2",
        "a field that is not listed can be set",
        "agents/_goal_model.py",
        "            visible = path in self._limits if exposed is None else exposed\n",
        "            visible = True if exposed is None else exposed\n",
        ("agents/test_agents_config.py::test_only_what_is_listed_is_exposed",),
    ),
    Mutant(
        "C10.2",
        "a field that does not exist passes unseen",
        "agents/_goal_model.py",
        'core_schema.typed_dict_schema(fields, extra_behavior="forbid")',
        'core_schema.typed_dict_schema(fields, extra_behavior="ignore")',
        ("agents/test_agents_arguments.py::test_values_outside_of_limits",),
    ),
    Mutant(
        "C10.2",
        "a number that is rounded to 32 bits leaves its limits",
        "agents/_goal_values.py",
        "        if float(near) > high:\n",
        "        if False:\n",
        (
            "agents/test_agents_arguments.py::test_numbers_are_sent_within_limits_also_after_rounding",
        ),
    ),
    Mutant(
        "C10.2",
        "a number with one limit of two is not warned of",
        "agents/_goal_model.py",
        " and None in (own.minimum, own.maximum):",
        " and own.minimum is own.maximum is None:",
        ("agents/test_agents_config.py::test_numbers_without_limits_are_warned_of",),
    ),
    Mutant(
        "C10.2",
        "goals of other programs do not count",
        "agents/_goals.py",
        "        return [goal for goal in there if goal.goal_id not in sent]\n",
        "        return []\n",
        (
            "agents/test_toolbox_human.py::"
            "test_a_goal_that_others_sent_while_the_stop_was_not_known_counts",
        ),
    ),
    Mutant(
        "C10.2",
        "two calls at the same moment pass the limit",
        "agents/_goals.py",
        "            if sum(one.counts for one in self._records if one.action == record.action)"
        " >= limit:\n                return False\n",
        "",
        ("agents/test_agents_results.py::test_calls_at_the_same_moment_do_not_pass_the_limit",),
    ),
    Mutant(
        "C10.2",
        "a goal is sent though the goals of others cannot be looked for",
        "agents/_goal_call.py",
        "            raise self._failed(tool, error) from error\n        if len(running)",
        "            _log.warning('%s', error)\n        if len(running)",
        (
            "agents/test_toolbox.py::"
            "test_nothing_is_sent_where_the_goals_of_others_cannot_be_looked_for",
        ),
    ),
    Mutant(
        "C10.3",
        "a human's question is good for two goals",
        "agents/_mcp/approval.py",
        '        until, stops = self._open.pop(mark or "", (0.0, -1))\n',
        '        until, stops = self._open.get(mark or "", (0.0, -1))\n',
        ("agents/over_mcp/test_mcp_answers.py::test_a_question_is_good_for_one_goal",),
    ),
    Mutant(
        "C10.3",
        "anything but no is an approval",
        "agents/_mcp/approval.py",
        '    return action == "accept" and (content or {}).get(_FIELD) is True\n',
        '    return action == "accept"\n',
        ("agents/over_mcp/test_mcp_calls.py::test_a_human_is_asked_first",),
    ),
    Mutant(
        "C10.3",
        "a call is approved that was given up while the human was asked",
        "agents/_goal_call.py",
        "        asking.cancel()\n        raise\n",
        "        asking.cancel()\n        await asyncio.wait([asking])\n",
        ("agents/test_toolbox_human.py::test_an_answer_that_crosses_with_giving_up_sends_nothing",),
    ),
    Mutant(
        "C10.3",
        "a goal is sent for a client that was gone before its call began",
        "agents/_mcp/calls.py",
        "            if gone.is_set():\n                raise GoneError\n",
        "",
        (
            "agents/over_mcp/test_mcp_calls_alone.py::"
            "test_a_client_that_is_gone_gets_nothing_sent_or_its_goal_cancelled",
        ),
    ),
    Mutant(
        "C10.3",
        "the goal of a client that is gone runs on",
        "agents/_mcp/calls.py",
        "                [task] if vanished is None else [task, vanished],\n",
        "                [task],\n",
        (
            "agents/over_mcp/test_mcp_calls_alone.py::"
            "test_a_client_that_is_gone_gets_nothing_sent_or_its_goal_cancelled",
        ),
    ),
    Mutant(
        "C10.3",
        "a call that begins when the process ends sends a goal",
        "agents/_mcp/calls.py",
        "            await asyncio.wait(self._after)\n        if self._ending:\n"
        "            raise EndingError(_NOT_BEGUN)\n",
        "            await asyncio.wait(self._after)\n",
        (
            "agents/over_mcp/test_mcp_calls_alone.py::"
            "test_a_call_whose_task_begins_when_the_process_ends_sends_nothing",
        ),
    ),
    Mutant(
        "C10.3",
        "a second request with the id of one that runs is served, so nobody can cancel the first",
        "agents/_mcp/stdio.py",
        "        return len(self._running) == before\n",
        "        return False\n",
        (
            "agents/over_mcp/test_mcp_stdio.py::test_an_id_that_is_used_again_while_its_request_runs",
        ),
    ),
    Mutant(
        "C10.3",
        "what a library prints is mixed into the protocol",
        "agents/_mcp/stdio.py",
        "            os.dup2(2, 1)\n",
        "            pass\n",
        ("agents/over_mcp/test_mcp_wire.py::test_stdout_is_the_protocols",),
    ),
    Mutant(
        "C10.3",
        "goals run on if the event loop hangs when the process ends",
        "agents/_mcp/process.py",
        '        self._toolbox._calls.cancel_all("all goals were cancelled")'
        "  # here, as the loop may hang\n",
        "",
        (
            "agents/over_mcp/test_mcp_process.py::test_a_signal_cancels_and_ends_in_time[True-SIGINT-130]",
        ),
    ),
    Mutant(
        "C10.3",
        "a process with an event loop that hangs does not end",
        "agents/_mcp/process.py",
        "            timer.start()\n",
        "            pass\n",
        (
            "agents/over_mcp/test_mcp_process.py::test_a_signal_cancels_and_ends_in_time[True-SIGINT-130]",
        ),
    ),
    Mutant(
        "C10.4",
        "while it is not known whether a human holds, nobody does",
        "_ros/holds/view.py",
        "            return _CUT_OFF if self._cut_off else _NOT_YET\n",
        '            return ""\n',
        ("agents/test_hold.py::test_free_only_when_that_is_known",),
    ),
    Mutant(
        "C10.4",
        "a listener that is broken says that nobody holds",
        "agents/_hold.py",
        '            return (), f"{type(error).__name__}: {error}"\n',
        "            return (), None\n",
        ("agents/test_hold.py::test_after_an_error_of_the_listener_it_is_not_known",),
    ),
    Mutant(
        "C10.4",
        "a file that cannot be read has no hold",
        "_ros/holds/view.py",
        "        except (OSError, ValueError) as error:\n"
        '            return f"{type(error).__name__}: {error}"\n',
        '        except (OSError, ValueError):\n            return ""\n',
        (
            "agents/test_hold_state.py::"
            "test_a_file_that_cannot_be_read_is_no_file_that_tells_nothing",
        ),
    ),
    Mutant(
        "C10.4",
        "a message that cannot be read has no hold",
        "_ros/holds/state.py",
        "        return HoldState({hold.hold_id: hold}), None\n",
        "        return HoldState(), None\n",
        ("agents/test_hold_state.py::test_what_cannot_be_read_is_a_hold_that_can_be_released",),
    ),
    Mutant(
        "C10.4",
        "a process that stood still believes what it knew before",
        "_ros/holds/view.py",
        "        if not self._settled or _uptime() - self._looked > _GAP:\n",
        "        if not self._settled:\n",
        ("agents/test_hold.py::test_free_only_when_that_is_known",),
    ),
    Mutant(
        "C10.4",
        "a release that is heard before its hold does not end it",
        "_ros/holds/state.py",
        "    left = sorted(hold_id for hold_id in holds if hold_id not in released)[:MOST_HOLDS]\n",
        "    left = sorted(holds)[:MOST_HOLDS]\n",
        ("agents/test_hold_state.py::test_a_release_ends_what_it_knows_of_and_nothing_else",),
    ),
    Mutant(
        "C10.4",
        "a goal is sent although a human has stopped the robot",
        "agents/_goal_call.py",
        "        if (why := hold.why_held()) is None:\n",
        "        if (why := hold.why_held()) is None or hold.is_known:\n",
        ("agents/test_toolbox_human.py::test_a_hold_refuses_and_cancels",),
    ),
    Mutant(
        "C10.4",
        "a goal that no server knows yet is not cancelled by a human's stop",
        "agents/_goal_call.py",
        "        clients.on_hold = self.cancel_all\n",
        "",
        ("agents/test_toolbox_human.py::test_a_hold_refuses_and_cancels",),
    ),
    Mutant(
        "C10.4",
        "what waited for an approval is sent after a stop and a release",
        "agents/_goal_call.py",
        "            if self.stops != stops:\n",
        "            if False:\n",
        (
            "agents/test_stop_toolbox.py::"
            "test_an_approval_given_while_the_robot_was_stopped_and_released_does_not_count",
        ),
    ),
    Mutant(
        "C10.4",
        "a goal that failed is sent again though it is not known whether a human holds",
        "agents/_goal_call.py",
        "            if not hold.surely_free:\n",
        "            if False:\n",
        (
            "agents/test_toolbox_human.py::"
            "test_a_failed_goal_is_sent_again_only_if_surely_nobody_has_stopped_the_robot",
        ),
    ),
    Mutant(
        "C10.4",
        "a server that answers with an error counts as stopped",
        "_ros/stopping/cancelling.py",
        "        self._consents[said.request] += not said.code\n",
        "        self._consents[said.request] += 1\n",
        ("unit/test_stopping.py::test_an_error_is_no_consent",),
    ),
    Mutant(
        "C10.4",
        "the answer of one of two servers is enough",
        "_ros/stopping/cancelling.py",
        "        return self._most_of(self._answers) < max(1, len(self.board.servers))\n",
        "        return self._most_of(self._answers) < 1\n",
        ("unit/test_stopping.py::test_every_server_on_the_name_has_to_answer",),
    ),
    Mutant(
        "C10.4",
        "a server that did not answer ends in code 0",
        "cli/cancel_and_stop/_stop_table.py",
        "    return Exit.CANCEL_UNKNOWN if code is Exit.OK and action.unheard else code\n",
        "    return code\n",
        ("unit/test_stopping.py::test_a_server_that_says_nothing_may_have_goals",),
    ),
    Mutant(
        "C10.4",
        "goals that were accepted while servers were looked for run on",
        "_ros/stopping/cancel_goals.py",
        "                for action in actions:\n                    action.once_more()\n",
        "",
        ("unit/test_stopping.py::test_goals_accepted_while_servers_are_looked_for_are_canceled",),
    ),
    Mutant(
        "C10.4",
        "a hold that is in no file is no error",
        "cli/cancel_and_stop/stop.py",
        "    return Exit.FAILED if late or unwritten or not kept else Exit.OK\n",
        "    return Exit.FAILED if late or not kept else Exit.OK\n",
        ("cli/test_stop.py::test_a_hold_that_is_in_no_file_is_told_of",),
    ),
    Mutant(
        "C10.4",
        "a stop goes on while others send goals",
        "_ros/stopping/cancel_goals.py",
        "(done or (over(now) and now >= last))",
        "done",
        ("unit/test_stopping.py::test_a_stop_keeps_its_time_while_others_send_goals",),
    ),
    Mutant(
        "C10.5",
        "a message that is older than allowed is returned",
        "_ros/tools/topic.py",
        "                if max_age is None or now - at <= max_age * 1e9:\n",
        "                if True:\n",
        ("agents/test_topic_reader.py::test_the_newest_is_returned_unless_it_is_too_old",),
    ),
    Mutant(
        "C10.5",
        "of the messages that publishers keep, the oldest is returned",
        "_ros/tools/topic.py",
        "                    if newest is None or at > newest[0]:\n",
        "                    if newest is None or at < newest[0]:\n",
        ("agents/test_topic_reader.py::test_the_newest_is_returned_unless_it_is_too_old",),
    ),
    Mutant(
        "C10.5",
        "a topic stays subscribed to after it was read",
        "_ros/tools/topic.py",
        "            self.runtime.node.destroy_subscription(source.subscription)\n",
        "            pass\n",
        ("agents/test_topic_reader.py::test_each_publisher_is_read_as_it_offers",),
    ),
)
