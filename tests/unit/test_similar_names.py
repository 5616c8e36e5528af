"""Similar names, for hints."""

from __future__ import annotations

from actionkit._model.similar_names import similar_names

ACTIONS = ["/robot_1/navigate_to_pose", "/robot_2/dock", "/navigate_through_poses", "/spin"]


def test_a_slip_of_the_pen_is_found() -> None:
    assert similar_names("ordr", ["order", "sequence"]) == ["order"]
    assert similar_names("/spinn", ACTIONS) == ["/spin"]


def test_the_last_part_alone_is_enough() -> None:
    assert similar_names("/a_very_long_namespace/of_some_robot/dock", ACTIONS) == ["/robot_2/dock"]
    assert similar_names("/a_very_long_namespace/of_some_robot/docks", ACTIONS) == ["/robot_2/dock"]


def test_nothing_like_it_is_no_hint() -> None:
    assert similar_names("/a_very_long_namespace/of_some_robot/dork", ACTIONS) == []
    assert similar_names("/grasp", ACTIONS) == []
    assert similar_names("/dock", []) == []


def test_the_whole_name_can_be_held_to_more() -> None:
    types = ["test_msgs/action/NestedMessage"]
    assert similar_names("test_msgs/action/NestingMassages", types) == types
    assert similar_names("tests_msgs/action/Fibonacci", types) == types
    assert similar_names("tests_msgs/action/Fibonacci", types, alike=0.7) == []


def test_a_hint_is_short_and_names_nothing_twice() -> None:
    many = [f"/robot_{number}/dock" for number in range(20)]
    found = similar_names("/robot_3/dock", many)
    assert found[0] == "/robot_3/dock"
    assert len(found) == len(set(found)) == 5
    assert len(similar_names("order", [f"order{number}" for number in range(9)])) == 3
