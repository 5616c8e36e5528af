"""The rooms of the library, and that imports between them run one way."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import actionkit

ROOT = Path(actionkit.__file__).parent

# From the bottom up: a module imports only from layers below its own.
LAYERS: list[set[str]] = [
    {"_printable"},
    {
        "_action_type",
        "_arguments",
        "_clock",
        "_diagnostics",
        "_errors",
        "_field_errors",
        "_observers",
        "_surroundings",
        "_timeline_text",
        "_waiting",
    },
    {"_blocked", "_decode", "_left_running"},
    {"_delivery", "_field_paths", "_field_types", "_settings", "_values"},
    {"_asking", "_feedback"},
    {"_feedback_tape"},
    {
        "_budget",
        "_effects",
        "_fields",
        "_observers.channel",
        "_observers.protocol",
        "_observers.words",
        "_timeline",
    },
    {
        "_observers.goal_log",
        "_observers.json_schema",
        "_observers.rosout",
        "_observers.telemetry",
    },
    {"_observers.audience", "_observers.json_lines", "_observers.json_reader"},
    {"_classify", "_explain", "_future", "_retry", "_stages"},
    {"_goal", "_judging", "_request", "_retrying"},
    {"_attempt"},
    {"_call"},
    {"_carrier"},
    {"_session"},
    {"_exit"},
    {"_client"},
    {""},  # actionkit itself
]
ROS_LAYERS: list[set[str]] = [
    {"_clock", "_diagnostics", "_errors", "_waiting"},
    {"_ros.discovery", "_ros.graph", "_ros.listener", "_ros.native", "_ros.outbox", "_ros.wire"},
    {
        "_ros.cancels",
        "_ros.entities",
        "_ros.names",
        "_ros.presence",
        "_ros.runtime",
        "_ros.strays",
    },
    {
        "_ros.feedback",
        "_ros.liveness",
        "_ros.requests",
        "_ros.rollcall",
        "_ros.status",
    },
    {"_ros.lookout", "_ros.runtimes"},
    {"_ros.link", "_ros.roundtrip", "_ros.survey", "_ros.watch"},
    {"_ros.port"},
    {"_carrier"},
]
APART = ("cli", "servers", "testing", "__main__")
"""Programs and servers of their own, built on the library or beside it."""
PURE = (
    "_goal",
    "_stages",
    "_effects",
    "_timeline",
    "_timeline_text",
    "_observers.json_schema",
    "_printable",
    "_clock",
    "_explain",
    "_retry",
    "_values",
    "_ros.cancels",
    "_ros.outbox",
    "_ros.wire",
)
ROS = ("rclpy", "action_msgs", "unique_identifier_msgs")
LONGEST = 350
LONGER = {
    "_call.py": 425,  # the turns of a call; what decides them is elsewhere
    "_goal.py": 625,  # one table of situations and events; half of it would tell half the story
}


@cache
def modules() -> dict[str, Path]:
    """Return every module by its name below `actionkit`; a package goes by its own name."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(part for part in parts if part != "__init__")] = path
    return found


def is_apart(name: str) -> bool:
    return name.split(".", maxsplit=1)[0] in APART


def library() -> dict[str, Path]:
    return {name: path for name, path in modules().items() if not is_apart(name)}


def walked(node: ast.AST, *, runtime: bool, top: bool) -> Iterator[ast.AST]:
    """Yield the nodes below, without `if TYPE_CHECKING:`, or without functions, where asked."""
    for child in ast.iter_child_nodes(node):
        checking = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)
        function = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        if (runtime and checking) or (top and function):
            continue
        yield child
        yield from walked(child, runtime=runtime, top=top)


@cache
def imports(name: str, *, runtime: bool = True, top: bool = False) -> frozenset[str]:
    """Return the full names of all that a module imports, whether modules or what is in them."""
    path = modules()[name]
    package = ["actionkit", *path.relative_to(ROOT).parent.parts]
    found = set()
    for node in walked(ast.parse(path.read_text("utf-8")), runtime=runtime, top=top):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*start, *(node.module or "").split(".")]).strip(".")
            found.update(f"{base}.{alias.name}" for alias in node.names)
    return frozenset(found)


def own_imports(name: str, *, runtime: bool = True, top: bool = False) -> set[str]:
    """Return the modules of ActionKit that a module imports."""
    found = set()
    for full in imports(name, runtime=runtime, top=top):
        if full.split(".")[0] == "actionkit":
            below = full.removeprefix("actionkit").removeprefix(".")
            found.add(below if below in modules() else below.rpartition(".")[0])
    return found - {name}


def imports_package(name: str, package: str) -> bool:
    every = imports(name, runtime=False)
    return any(full == package or full.startswith(package + ".") for full in every)


# --- one way -----------------------------------------------------------------------------------


def test_every_module_has_its_layer() -> None:
    known = set().union(*LAYERS, *ROS_LAYERS) | {"_ros"}
    assert set(library()) == known, "a new module: give it a layer in this file"


@pytest.mark.parametrize("layers", [LAYERS, ROS_LAYERS], ids=["library", "_ros"])
def test_imports_run_one_way(layers: list[set[str]]) -> None:
    height = {name: number for number, layer in enumerate(layers) for name in layer}
    wrong = [
        f"{name} imports {other}"
        for name in height
        for other in own_imports(name)
        if other in height and height[other] >= height[name]
    ]
    assert wrong == []


def test_there_are_no_cycles() -> None:
    left = {name: own_imports(name, top=True) & set(modules()) for name in modules()}
    while free := [name for name, needed in left.items() if not needed & set(left)]:
        for name in free:
            del left[name]
    assert left == {}


def test_the_room_of_rclpy_knows_nothing_of_calls() -> None:
    for name in library():
        if name.startswith("_ros"):
            outside = {other for other in own_imports(name) if not other.startswith("_ros")}
            assert outside <= {"_clock", "_diagnostics", "_errors", "_waiting"}, name


def test_what_is_built_on_the_library_is_not_imported_by_it() -> None:
    for name in library():
        assert not [other for other in own_imports(name) if is_apart(other)], name


def test_nobody_imports_the_command_line() -> None:
    for name in modules():
        if name.split(".")[0] not in ("cli", "__main__"):
            assert not [o for o in own_imports(name) if o.split(".")[0] == "cli"], name


@pytest.mark.parametrize("package", ["servers", "testing"])
def test_servers_and_test_tools_use_nothing_of_the_client(package: str) -> None:
    for name in modules():
        if name.split(".")[0] == package:
            others = own_imports(name) - {"_ros.discovery"}  # every rclpy node needs that one
            assert {other.split(".")[0] for other in others} <= {"servers", "testing"}, name


# --- what may be used where --------------------------------------------------------------------


@pytest.mark.parametrize("package", ROS)
def test_one_room_touches_rclpy(package: str) -> None:
    users = {name for name in library() if imports_package(name, package)}
    assert users
    assert {name for name in users if not name.startswith("_ros.")} == set()


def test_one_module_touches_the_private_parts_of_rclpy() -> None:
    for name, path in library().items():
        if name == "_ros.native":
            assert imports_package(name, "rclpy.impl")
            continue
        for full in imports(name, runtime=False):
            parts = full.split(".")
            private = parts[0] == "rclpy" and ("impl" in parts or any(p[0] == "_" for p in parts))
            assert not private, f"{name} imports {full}"
        if name.startswith("_ros."):
            tree = ast.parse(path.read_text("utf-8"))
            foreign = [
                ast.unparse(node)
                for node in ast.walk(tree)
                if isinstance(node, ast.Attribute)
                and node.attr.startswith("_")
                and not node.attr.startswith("__")
                and ast.unparse(node.value) not in ("self", "cls")
            ]
            assert foreign == [], name


@pytest.mark.parametrize("name", PURE)
def test_pure_modules_know_no_threads_no_clock_and_no_middleware(name: str) -> None:
    for module in ("threading", "time", "asyncio", "logging", *ROS):
        assert not imports_package(name, module), module


def test_one_module_touches_tenacity() -> None:
    assert {name for name in library() if imports_package(name, "tenacity")} == {"_retry"}


def test_one_module_touches_opentelemetry() -> None:
    users = {name for name in library() if imports_package(name, "opentelemetry")}
    assert users == {"_observers.telemetry"}


def test_the_state_machine_knows_only_its_own_words() -> None:
    assert own_imports("_goal", runtime=False) == {"_effects", "_settings", "_stages", "_values"}


# --- sizes and costs ---------------------------------------------------------------------------


def test_files_are_short() -> None:
    for path in modules().values():
        relative = path.relative_to(ROOT).as_posix()
        lines = len(path.read_text("utf-8").splitlines())
        assert lines <= LONGER.get(relative, LONGEST), relative


def test_every_module_says_what_it_is_for() -> None:
    for name, path in modules().items():
        assert ast.get_docstring(ast.parse(path.read_text("utf-8"))), name


HEAVY = (
    "rclpy",
    "opentelemetry",
    "rich",
    "click",
    "yaml",
    "numpy",
    "test_msgs",
    "action_msgs",
    "rosidl_parser",
    "pytest",
)


@pytest.mark.parametrize("module", ["actionkit", "actionkit.cli", "actionkit.testing.plugin"])
def test_importing_is_light(module: str) -> None:
    allowed = {"pytest"} if "plugin" in module else set()
    code = f"import sys, {module}; print(*[m for m in {HEAVY} if m in sys.modules])"
    run = [sys.executable, "-W", "error", "-c", code]
    out = subprocess.run(run, capture_output=True, text=True, timeout=60, check=True).stdout
    assert set(out.split()) <= allowed
