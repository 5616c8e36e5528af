"""That docs/attacks.md is whole, and how its rows are compared."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.faults import attacks, attacks_page
from tests.faults.attacks import Attack, Row
from tests.faults.conftest import WRITING_ATTACKS

ATTACK = attacks.given_up("close", 10)
ROW = Row(ATTACK, left=0, wrong=0, delay=1.0)


@pytest.mark.skipif(WRITING_ATTACKS, reason="docs/attacks.md is being written")
def test_the_page_of_attacks_has_a_row_for_each_and_no_other():
    text = attacks.PATH.read_text()
    written = [attack for attack in attacks.read(text) if attack.section != attacks.SOAK]
    assert written == attacks.attacks()
    assert attacks.merge([], text) == text, "its words are not those of tests/faults/attacks_page"


def test_what_is_written_of_attacks_is_read_back():
    soak = Attack(attacks.SOAK, "60 minutes", "12,345 calls")
    rows = [ROW, Row(soak, 0, 0, 0.5), replace(ROW, attack=attacks.race("takes"), delay=40)]
    text = attacks.merge(rows, "")
    assert attacks.read(text) == {row.attack: row.bound for row in rows}
    assert attacks.merge([], text) == text
    assert text.startswith(attacks_page.INTRO.strip())
    again = attacks.merge([replace(ROW, delay=9.0)], text)
    assert attacks.read(again)[ATTACK] == 20
    assert attacks.read(again)[soak] == 5


@pytest.mark.parametrize("change", [{"left": 1}, {"wrong": 1}])
def test_the_page_never_tells_of_a_goal_left_running_or_a_wrong_outcome(change):
    text = attacks.merge([replace(ROW, **change)], "")
    with pytest.raises(ValueError, match="must not say"):
        attacks.read(text)


def test_an_attack_that_took_too_long_is_found():
    written = {ATTACK: 5.0}
    assert attacks.differs(ROW, written) == ""
    assert "the page says < 5 s" in attacks.differs(replace(ROW, delay=5.5), written)
    assert "not on the page" in attacks.differs(ROW, {})
