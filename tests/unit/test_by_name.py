"""Types are found by their names; an error says what to do, and proposes only what exists."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from std_msgs.msg import String
from test_msgs.action import Fibonacci
from test_msgs.msg import Empty

from actionkit._messages.by_name import (
    BrokenPackageError,
    Kind,
    action_name,
    installed,
    interface_class,
)

WORKSPACE = "If it is in a workspace of yours, source that: `source install/setup.bash`."
NONE_INSTALLED = "None at all are installed: source the setup file of your workspace."
Package = Callable[[str, str], None]


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Package]:
    """Make packages, which are all that is installed: the name of the module, and its text."""

    made = {"actionkit_interfaces", "nav2_msgs", "stereo_msgs"}

    def make(name: str, text: str) -> None:
        made.add(name.partition(".")[0])
        folder = tmp_path.joinpath(*name.split("."))
        folder.mkdir(parents=True)
        (folder.parent / "__init__.py").touch()
        (folder / "__init__.py").write_bytes(text.encode("latin-1"))

    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    real = forget(made)
    yield make
    forget(made)
    sys.modules.update(real)


def forget(packages: set[str]) -> dict[str, ModuleType]:
    installed.cache_clear()
    names = [name for name in sys.modules if name.partition(".")[0] in packages]
    return {name: sys.modules.pop(name) for name in names}


def lines(package: str, kind: str, *names: str) -> str:
    """Return what rosidl writes into the `__init__.py` of a package."""
    return "".join(f"from {package}.{kind}._some import {name}  # noqa: F401\n" for name in names)


def refused(name: str, kind: Kind = "action") -> str:
    with pytest.raises(ValueError, match=r"\.|\?$") as caught:
        interface_class(name, kind)
    assert type(caught.value) is ValueError
    return str(caught.value)


def test_a_type_is_found_by_its_name() -> None:
    assert interface_class("test_msgs/action/Fibonacci", "action") is Fibonacci
    assert interface_class("test_msgs/msg/Empty", "msg") is Empty
    assert interface_class("std_msgs/msg/String", "msg") is String


def test_the_name_of_an_action_type() -> None:
    for given in (Fibonacci, "test_msgs/action/Fibonacci"):
        assert action_name(given) == "test_msgs/action/Fibonacci"
    with pytest.raises(ValueError, match=r"^'test_msgs/msg/Empty' is not an action type: one is"):
        action_name("test_msgs/msg/Empty")
    for wrong in (Empty, Fibonacci.Goal, None, 5):
        with pytest.raises(TypeError) as caught:
            action_name(wrong)
        assert str(caught.value) == (
            f"action_type={wrong!r} must be an action class, such as test_msgs.action.Fibonacci;"
            " not a message, a service, or its Goal"
        )


def test_what_is_installed_is_read_without_importing_it(
    package: Package, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = [f"Pick_{part}" for part in ("SendGoal_Request", "GetResult_Response", "SendGoal")]
    package("pick_msgs.action", lines("pick_msgs", "action", "Place", "Pick", *parts) + "raise\n")
    package("other_msgs.action", lines("pick_msgs", "action", "Foreign"))
    package("bad_msgs.action", lines("bad_msgs", "action", "Lost") + "# \xff")
    package("ab.action", lines("ab", "action", "Dig"))
    package("pick_msgs.msg", lines("pick_msgs", "msg", "Object"))
    assert installed() == ("ab/action/Dig", "pick_msgs/action/Pick", "pick_msgs/action/Place")
    assert installed("msg") == ("pick_msgs/msg/Object",)
    with monkeypatch.context() as patch:  # which ends before that of `package`
        patch.chdir(tmp_path)
        patch.setattr(sys, "path", [""])  # the current folder
        installed.cache_clear()
        assert "ab/action/Dig" in installed()


@pytest.mark.parametrize(
    ("name", "kind", "problem"),
    [
        (
            "pick_msgs/Pick",
            "action",
            "'pick_msgs/Pick' is not an action type: one is written as test_msgs/action/Fibonacci.",
        ),
        (
            "pick_msgs/action/Pick",
            "msg",
            "'pick_msgs/action/Pick' is not a message type: one is written as std_msgs/msg/String.",
        ),
        (
            "nav_msgz/action/Go",
            "action",
            f"the package 'nav_msgz' is not installed here. {WORKSPACE} Or build it from its"
            " source with `actionkit interfaces build`.",
        ),
        (
            "nav2_msgs/action/NavigateToPose",
            "action",
            f"the package 'nav2_msgs' is not installed here. {WORKSPACE} Or build it from its"
            " source (https://github.com/ros-navigation/navigation2) with `actionkit interfaces"
            " build`.",
        ),
        (
            "stereo_msgs/msg/DisparityImage",
            "msg",
            f"the package 'stereo_msgs' is not installed here. {WORKSPACE} Install it: `pip install"
            " ros-jazzy-stereo-msgs`, or `sudo apt install ros-jazzy-stereo-msgs`.",
        ),
        (
            "actionkit_interfaces/msg/Hold",
            "msg",
            "the package 'actionkit_interfaces' is not installed here. `actionkit interfaces build"
            " --own --install` makes it.",
        ),
    ],
)
def test_what_cannot_be_found(package: Package, name: str, kind: Kind, problem: str) -> None:
    assert refused(name, kind) == f"{problem} {NONE_INSTALLED}"


def test_a_package_without_such_a_type(package: Package) -> None:
    package("lacking_msgs.msg", "class Speed: SLOT_TYPES = ()\nclass Half: ...\n")
    assert refused("lacking_msgs/action/Pick") == (
        f"the package 'lacking_msgs' has no actions. {NONE_INSTALLED}"
    )
    for name in ("Spead", "Half"):
        assert refused(f"lacking_msgs/msg/{name}", "msg") == (
            f"the package 'lacking_msgs' has no message {name!r}. {NONE_INSTALLED}"
        )
    found: Any = interface_class("lacking_msgs/msg/Speed", "msg")
    assert found.__name__ == "Speed"


def test_similar_types_are_named_or_some_that_are_installed(package: Package) -> None:
    package("pick_msgs.action", lines("pick_msgs", "action", "Pick", "Picks"))
    assert refused("pick_msg/action/Picki").endswith(
        " Did you mean pick_msgs/action/Pick or pick_msgs/action/Picks?"
    )
    package("dig_msgs.action", f'"""\n{lines("dig_msgs", "action", "Dug")}"""')
    package("say_msgs.msg", "")
    installed.cache_clear()
    for name, problem in (
        ("pick_msgs/Pick", "'pick_msgs/Pick' is not an action type"),
        ("dig_msgs/action/Pick", "the package 'dig_msgs' has no action 'Pick'."),
        ("say_msgs/action/Pick", "the package 'say_msgs' has no actions."),
    ):
        found = refused(name)
        assert found.startswith(problem)
        assert "Did you mean pick_msgs/action/Pick or pick_msgs/action/Picks" in found
    for name in ("zzzz/action/Bake", "zick/action/Bake"):
        assert refused(name).endswith(
            " Installed are: dig_msgs/action/Dug, pick_msgs/action/Pick, pick_msgs/action/Picks."
        )
    package("many_msgs.action", lines("many_msgs", "action", *(f"A{i}" for i in range(6))))
    installed.cache_clear()
    some = ["dig_msgs/action/Dug", *(f"many_msgs/action/A{i}" for i in range(6))]
    names = ", ".join([*some, "pick_msgs/action/Pick"])  # one is left
    assert refused("zzzz/action/Bake").endswith(f" Installed are: {names} and more.")
    package("last_msgs.msg", lines("last_msgs", "msg", *(f"A{i}" for i in range(8))))
    installed.cache_clear()
    assert refused("zzzz/msg/Bake", "msg").endswith("last_msgs/msg/A7.")


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("import nowhere_at_all", "ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("raise OSError('no such library')", "OSError: no such library"),
    ],
)
def test_a_package_that_cannot_be_imported(package: Package, text: str, cause: str) -> None:
    package("broken_msgs.action", text)
    with pytest.raises(BrokenPackageError) as caught:
        interface_class("broken_msgs/action/Pick", "action")
    assert str(caught.value) == (
        f"the package 'broken_msgs' is here, but cannot be imported ({cause}). Source the setup"
        " file of the workspace that it was built in, for this Python."
    )
    assert caught.value.__cause__ is not None
