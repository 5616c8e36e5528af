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
        (
            "agents/test_agents_results.py::"
            "test_what_may_run_or_cannot_succeed_is_not_to_be_tried_again",
        ),
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
        "self.value is None or self._goals.block_another(unless_gone=True, unless_unseen=True)",
        "self.value is None",
        ("agents/test_toolbox.py::test_a_goal_that_cannot_be_cancelled_is_not_sent_beside",),
    ),
    Mutant(
        "C10.1",
        "what the server rejected is tried again",
        "agents/_results.py",
        "status, isinstance(outcome.error, TransientError) and",
        "status,",
        (
            "agents/test_agents_results.py::"
            "test_what_may_run_or_cannot_succeed_is_not_to_be_tried_again",
        ),
    ),
    Mutant(
        "C10.1",
        "a goal that was never sent has an id, as if it was",
        "agents/_results.py",
        "        goal_id=str(outcome.goal_id) if sent else None,\n",
        "        goal_id=str(outcome.goal_id),\n",
        ("agents/test_toolbox.py::test_what_waits_for_a_server_does_not_run",),
    ),
    Mutant(
        "C10.1",
        "a call counts no more when the server of one of its goals has left",
        "_calls/call_view.py",
        "        return any(goal.blocks_another(**unless) for goal in self._goals)",
        "        return all(goal.blocks_another(**unless) for goal in self._goals)",
        (
            (
                "agents/test_agents_results.py::"
                "test_one_counts_while_a_goal_may_run_whose_server_has_not_left"
            ),
        ),
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
        ("agents/test_agents_results.py::test_no_goal_is_added_beyond_the_limit_of_its_action",),
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
        "C10.2",
        "arguments of any depth are walked through",
        "agents/_argument_size.py",
        "_DEEPEST = 32\n",
        "_DEEPEST = 10**6\n",
        ("agents/test_agents_arguments.py::test_what_is_too_deep_or_too_large_is_refused_at_once",),
    ),
    Mutant(
        "C10.2",
        "a value that is not in the list of values is sent",
        "agents/_goal_values.py",
        "        if value not in enum:\n",
        "        if False:\n",
        ("agents/test_agents_arguments.py::test_values_outside_of_limits",),
    ),
    Mutant(
        "C10.2",
        "the largest number of the configuration is no limit",
        "agents/_goal_model.py",
        "min(bounds[1], own.maximum)",
        "bounds[1]",
        ("agents/test_agents_arguments.py::test_values_outside_of_limits",),
    ),
    Mutant(
        "C10.2",
        "a field that must be given can be left out",
        "agents/_goal_model.py",
        "                required.append(name)\n",
        "                pass\n",
        ("agents/test_agents_config.py::test_required_fields_must_be_given",),
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
        "C10.3",
        "an approval outlives a human's stop",
        "agents/_mcp/approval.py",
        "        return until > time.monotonic() and stops == self._stops()\n",
        "        return until > time.monotonic()\n",
        ("agents/over_mcp/test_mcp_answers.py::test_a_question_is_good_for_one_goal",),
    ),
    Mutant(
        "C10.3",
        "an answer that is no yes counts as one",
        "agents/_goal_call.py",
        "    if await _answer(approve, ApprovalRequest(tool.name, whole, question)) is not True:\n",
        "    if not await _answer(approve, ApprovalRequest(tool.name, whole, question)):\n",
        ("agents/test_agents_results.py::test_nothing_but_true_is_an_approval",),
    ),
    Mutant(
        "C10.3",
        "the thread that watches the host tells nobody that it has gone",
        "agents/_mcp/stdio.py",
        "        poll.poll()\n        self._gone()\n",
        "        poll.poll()\n",
        (
            "agents/over_mcp/test_mcp_stdio.py::"
            "test_a_host_that_is_gone_is_noticed_even_if_the_event_loop_hangs[stdout-False]",
        ),
    ),
    Mutant(
        "C10.3",
        "a client with another token is let in",
        "agents/_mcp/http.py",
        '        if not hmac.compare_digest(token.encode(errors="replace"), self._token):\n',
        "        if not token:\n",
        ("agents/over_mcp/test_mcp_address.py::test_only_the_right_token_lets_in",),
    ),
    Mutant(
        "C10.3",
        "over HTTP, a second request with the id of one that runs is served",
        "agents/_mcp/http.py",
        "        if key in self._running:\n",
        "        if False:\n",
        ("agents/over_mcp/test_mcp_http.py::test_an_id_that_is_used_again_while_its_call_runs",),
    ),
    Mutant(
        "C10.3",
        "no human is asked",
        "agents/_goal_call.py",
        '            if tool.confirm == "always":\n',
        "            if False:\n",
        ("agents/over_mcp/test_mcp_calls.py::test_a_human_is_asked_first",),
    ),
    Mutant(
        "C10.3",
        "the goal of a request that is cancelled runs on",
        "agents/_mcp/calls.py",
        "                    task.cancel()\n                    #",
        "                    pass\n                    #",
        (
            (
                "agents/over_mcp/test_mcp_calls_alone.py::"
                "test_a_client_that_is_gone_gets_nothing_sent_or_its_goal_cancelled"
            ),
        ),
    ),
    Mutant(
        "C10.3",
        "nobody sees that a client that waits has hung up",
        "agents/_mcp/http.py",
        "                pass\n            gone.set()",
        "                pass\n            return",
        (
            "agents/over_mcp/test_mcp_calls_alone.py::"
            "test_a_client_that_hangs_up_while_its_request_is_served_is_gone",
        ),
    ),
    Mutant(
        "C10.3",
        "the process ends before its goals were cancelled",
        "agents/_mcp/calls.py",
        "            await asyncio.wait_for(self._toolbox.cancel_all(), patience)",
        "            asyncio.ensure_future(self._toolbox.cancel_all())",
        (
            "agents/over_mcp/test_mcp_calls_alone.py::"
            "test_the_end_waits_until_the_goals_were_cancelled_and_not_for_ever",
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
        "a human's stop does not cancel the goals of agents",
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
        "C10.4",
        "one in sight that has not told what it knows is not waited for",
        "_ros/holds/view.py",
        "        return self._cut_off or len(silent) > len(long)\n",
        "        return False\n",
        (
            "agents/test_hold_state.py::"
            "test_who_is_in_sight_and_has_not_been_heard_may_know_of_a_hold",
        ),
    ),
    Mutant(
        "C10.4",
        "a message that is not merged yet does not keep a goal back",
        "_ros/holds/view.py",
        "        return not (self._texts or self._unknown() or self._state.active)\n",
        "        return not (self._unknown() or self._state.active)\n",
        ("agents/test_hold_state.py::test_a_message_that_was_not_read_yet_may_be_a_hold",),
    ),
    Mutant(
        "C10.4",
        "an agent does not tell others of the holds that it knows",
        "_ros/holds/view.py",
        "        if self._speaks and self._topic is not None and state != self._told:\n",
        "        if self._speaks and self._topic is not None and self._told is None:\n",
        ("agents/test_hold.py::test_held_by_the_topic_released_by_another_and_kept_by_who_knows",),
    ),
    Mutant(
        "C10.4",
        "a write to the file forgets the holds of others that are in it",
        "_ros/holds/files.py",
        "            state, old = merged(state, before := _read(str(path))), before\n",
        "            old = _read(str(path))\n",
        ("agents/test_hold_state.py::test_a_file_tells_others_at_once_and_is_never_undone",),
    ),
    Mutant(
        "C10.4",
        "other users cannot write a hold",
        "_ros/holds/files.py",
        "        directory.chmod(_FOR_ALL)\n",
        "        pass\n",
        ("agents/test_hold_state.py::test_a_file_tells_others_at_once_and_is_never_undone",),
    ),
    Mutant(
        "C10.4",
        "a release ends a stop that came later",
        "cli/cancel_and_stop/_holding.py",
        "        new = tuple(hold for hold in state.active if complete and",
        "        new = tuple(hold for hold in () if complete and",
        ("unit/test_stopping.py::test_a_release_does_not_end_a_stop_that_comes_after_it",),
    ),
    Mutant(
        "C10.4",
        "an agent that has not confirmed the hold is not told of",
        "cli/cancel_and_stop/_holding.py",
        "    others = [str(said.sender) for said in agents if not held & set(said.state.holds)]\n",
        "    others: list[str] = []\n",
        ("unit/test_stopping.py::test_an_agent_that_has_not_confirmed_the_hold_is_told_of",),
    ),
    Mutant(
        "C10.4",
        "a goal that has ended by itself after a cancel is told as canceled",
        "_ros/stopping/cancelling.py",
        '    if row.state == "CANCELED" and target.asked is not None:\n',
        "    if target.asked is not None:\n",
        ("cli/test_cancel.py::test_what_is_said_of_a_goal",),
    ),
    Mutant(
        "C10.4",
        "a server that is out of sight, with a client that may have goals, is not told of",
        "_ros/stopping/cancel_goals.py",
        "        if name not in by_name and survey.may_hide_goals(name):\n",
        "        if False:\n",
        (
            "cli/test_stop.py::test_a_server_that_stands_still_is_out_of_sight_and_its_client_is_not",
        ),
    ),
    Mutant(
        "C10.4",
        "a goal has stopped that a second server cancels yet",
        "_ros/stopping/cancelling.py",
        "        if len(row.entries) >= min(target.consents, self._most):\n",
        "        if True:\n",
        ("unit/test_stopping.py::test_what_one_of_two_servers_has_ended_may_run_on_the_other",),
    ),
    Mutant(
        "C10.4",
        "a goal has stopped that its server refuses to cancel",
        "_ros/stopping/cancelling.py",
        '        return "REFUSED", "The server',
        '        return "CONFIRMED", "The server',
        ("cli/test_cancel.py::test_what_is_said_of_a_goal",),
    ),
    Mutant(
        "C10.4",
        "a link in the place of the directory tells that nothing holds",
        "_ros/holds/files.py",
        "            if os.path.islink(directory):",
        "            if False:",
        ("agents/test_hold_state.py::test_a_link_in_the_place_of_the_directory_hides_no_hold",),
    ),
    Mutant(
        "C10.4",
        "a pipe in the place of a file is taken for one",
        "_ros/holds/files.py",
        "        if not stat.S_ISREG(os.lstat(path).st_mode):",
        "        if False:",
        ("agents/test_hold_state.py::test_what_is_in_the_place_of_a_file_may_be_a_hold[pipe]",),
    ),
    Mutant(
        "C10.4",
        "a message on the topic that cannot be decoded tells nothing",
        "_ros/holds/topic.py",
        "                text = repr(message[:200])\n",
        "                continue\n",
        (
            "agents/test_hold_state.py::test_a_message_that_is_none_of_the_middlewares_may_be_a_hold",
        ),
    ),
    Mutant(
        "C10.4",
        "nobody keeps the hold when the command has ended",
        "cli/cancel_and_stop/_keeper.py",
        "    _let_go()\n    while",
        "    return _let_go()\n    while",
        ("unit/test_stopping.py::test_the_keeper_stays_until_its_hold_is_released",),
    ),
    Mutant(
        "C10.4",
        "a stop whose background process does not come up holds nobody",
        "cli/cancel_and_stop/stop.py",
        "        view.add(HoldState({hold.hold_id: hold}))\n",
        "        pass\n",
        (
            (
                "unit/test_stopping.py::"
                "test_a_stop_holds_agents_itself_also_where_no_process_can_keep_its_hold"
            ),
        ),
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
