"""The layers of the library; imports between them go one way."""

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

#: What each package, or module at the top, may import of the others.
MAY_IMPORT: dict[str, set[str]] = {
    "_model": set(),
    "_threads": {"_model"},
    "_messages": {"_model", "_threads"},
    "_goal": {"_model"},
    "_observers": {"_model", "_threads", "_messages"},
    "_ros": {"_model", "_threads"},
    "_recordings": {"_model", "_messages", "_observers", "_ros"},
    "_calls": {"_model", "_threads", "_messages", "_goal", "_observers", "_recordings", "_ros"},
    "_client": {"_model", "_threads", "_messages", "_observers", "_ros", "_calls"},
    "_leftovers": {"_model", "_threads", "_messages", "_ros", "_calls", "_client"},
    "": {"_model", "_observers", "_calls", "_client", "_leftovers", "_recordings"},
    "_stubs": set(),
    "_interfaces": {"_model"},
    "_internal_api": {"_model", "_threads", "_calls", "_client", "_leftovers"},
    "trees": {"", "_internal_api", "_model", "_messages"},
    "agents": {"", "_internal_api", "_model", "_messages", "_ros"},
    "servers": {"_messages", "_ros"},
    "testing": {"_model", "_messages", "_ros", "servers"},
    "cli": {
        "",
        "_interfaces",
        "agents",
        "_model",
        "_messages",
        "_observers",
        "_internal_api",
        "_recordings",
        "_ros",
        "_stubs",
        "servers",
        "testing",
    },
    "__main__": {"cli"},
}
#: The same for the rooms of `_calls` and `_ros`; "" is what stands in no room.
ROOMS_MAY_IMPORT: dict[str, dict[str, set[str]]] = {
    "_calls": {
        "errors": set(),
        "ledger": set(),
        "on_signal": set(),
        "retries": set(),
        "awaiting": {"on_signal"},
        "futures": {"errors", "on_signal", "awaiting"},
        "sending": {"errors", "futures", "ledger", "on_signal", "retries", "awaiting"},
        "ending": {"futures", "ledger", "on_signal", "sending"},
        "": {"ending", "sending"},
    },
    "_ros": {
        "rclpy_private": set(),
        "endpoints": {"rclpy_private"},
        "workarounds": {"endpoints", "rclpy_private"},
        "communication": {"endpoints", "rclpy_private", "workarounds"},
        "answers": {"communication", "endpoints", "rclpy_private"},
        "holds": {"communication", "rclpy_private"},
        "others_goals": {"answers", "communication", "endpoints", "holds", "rclpy_private"},
        "servers_in_sight": {"answers", "communication", "endpoints", "rclpy_private"},
        "cancelling": {"answers", "communication", "endpoints", "others_goals", "rclpy_private"},
        "sending": {
            *(
                "answers",
                "cancelling",
                "communication",
                "endpoints",
                "rclpy_private",
                "servers_in_sight",
            )
        },
        "tools": {"communication", "rclpy_private", "sending"},
        "": set(),
    },
}
APART = ("_interfaces", "agents", "cli", "servers", "testing", "__main__")
"""Programs and servers of their own, built on the library or beside it."""
PURE = (
    "_goal",
    "_model",
    "_observers.json_schema",
    "_threads.clock",
    "_calls.sending.effects",
    "_calls.errors.error_texts",
    "_calls.errors.explain",
    "_calls.sending.machine",
    "_calls.errors.still_running",
    "_calls.retries.retry",
    "_ros.cancelling.cancels",
    "_ros.holds.state",
    "_ros.communication.outbox",
    "_ros.cancelling.cancelling",
    "_ros.others_goals.goal_board",
    "_ros.others_goals.server_numbers",
    "_ros.answers.wire",
)
ROS = ("rclpy", "action_msgs", "unique_identifier_msgs")


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


def package_of(name: str) -> str:
    return name.split(".", maxsplit=1)[0]


def test_imports_between_packages_run_one_way() -> None:
    assert {package_of(name) for name in modules()} == set(MAY_IMPORT)
    wrong = [
        f"{name} imports {other}"
        for name in modules()
        for other in own_imports(name)
        if package_of(other) not in MAY_IMPORT[package_of(name)] | {package_of(name)}
    ]
    assert wrong == []


def room_of(name: str) -> str:
    """Return the folder of a module below its package; "" if it stands in none."""
    return (*modules()[name].relative_to(ROOT).parent.parts[1:], "")[0]


@pytest.mark.parametrize("package", ROOMS_MAY_IMPORT)
def test_imports_between_rooms_run_one_way(package: str) -> None:
    may_import = ROOMS_MAY_IMPORT[package]
    inside = {name for name in modules() if package_of(name) == package}
    assert {room_of(name) for name in inside} == set(may_import)
    # Imports for the type checker and inside functions count here, too.
    wrong = [
        f"{name} imports {other}"
        for name in inside
        for other in own_imports(name, runtime=False) & inside
        if room_of(other) not in may_import[room_of(name)] | {room_of(name)}
    ]
    assert wrong == []
    left = dict(may_import)
    while free := [room for room, needed in left.items() if not needed & set(left)]:
        for room in free:
            del left[room]
    assert left == {}, "a circle"


def test_no_folder_has_many_files() -> None:
    folders = {path.parent for path in modules().values()}
    assert [each for each in folders if len(list(each.glob("*.py"))) > 16] == []


def test_a_family_of_commands_uses_what_all_share_and_few_others() -> None:
    arrows = {
        (name.split(".")[1], other.split(".")[1])
        for name in modules()
        for other in own_imports(name)
        if name.startswith("cli.") and other.startswith("cli.")
    }
    between = {(one, other) for one, other in arrows if one != other and other != "_shared"}
    assert between == {("cancel_and_stop", "watch"), ("mcp", "guard")}


def test_there_are_no_cycles() -> None:
    # Imports for the type checker and inside functions count: readers of the code follow them.
    left = {name: own_imports(name, runtime=False) & set(modules()) for name in modules()}
    while free := [name for name, needed in left.items() if not needed & set(left)]:
        for name in free:
            del left[name]
    assert left == {}


def test_servers_use_nothing_of_the_client_but_what_every_node_needs() -> None:
    used = {o for name in modules() if package_of(name) == "servers" for o in own_imports(name)}
    others = {name for name in used if package_of(name) != "servers"}
    assert others == {
        "_messages.by_name",
        "_ros.rclpy_private.native",
        "_ros.workarounds.listener_hang",
    }


def test_helpers_for_tests_use_two_tools_of_the_client() -> None:
    used = {o for name in modules() if package_of(name) == "testing" for o in own_imports(name)}
    tools = {"_ros.tools.contexts", "_ros.tools.presence"}
    assert {name for name in used if package_of(name) == "_ros"} == tools


def test_few_entries_at_the_top() -> None:
    assert len([path for path in ROOT.iterdir() if path.name != "__pycache__"]) <= 21


# --- what may be used where --------------------------------------------------------------------


@pytest.mark.parametrize("package", ROS)
def test_one_room_touches_rclpy(package: str) -> None:
    users = {name for name in library() if imports_package(name, package)}
    assert users
    assert {name for name in users if not name.startswith("_ros.")} == set()


def test_agents_do_not_touch_rclpy() -> None:
    agents = [name for name in modules() if package_of(name) == "agents"]
    assert not [name for name in agents for one in ROS if imports_package(name, one)]
    # Nor do they import it by its name.
    named = [name for name in agents if '"rclpy' in modules()[name].read_text("utf-8")]
    assert named == []


def test_three_modules_touch_the_private_parts_of_rclpy() -> None:
    assert imports_package("_ros.rclpy_private.native", "rclpy.impl")
    for name, path in library().items():
        if name in (
            "_ros.rclpy_private.native",
            "_ros.rclpy_private.wait_set",
            "_ros.rclpy_private.executors",
        ):
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
    below = [module for module in library() if module == name or module.startswith(name + ".")]
    for module in ("threading", "time", "asyncio", "logging", *ROS):
        assert not [one for one in below if imports_package(one, module)], module


def test_one_module_touches_tenacity() -> None:
    assert {name for name in library() if imports_package(name, "tenacity")} == {
        "_calls.retries.retry"
    }


def test_one_module_touches_opentelemetry() -> None:
    users = {name for name in library() if imports_package(name, "opentelemetry")}
    assert users == {"_observers.telemetry"}


def test_one_package_touches_py_trees() -> None:
    users = {name for name in library() if imports_package(name, "py_trees")}
    assert {package_of(name) for name in users} == {"trees"}


def test_the_state_machine_knows_only_its_own_words() -> None:
    for name in library():
        if package_of(name) == "_goal":
            others = {o for o in own_imports(name, runtime=False) if package_of(o) != "_goal"}
            assert others <= {"_model.cancel_answer", "_model.settings", "_model.values"}, name


def test_one_module_runs_the_generators() -> None:
    found = {
        name
        for name, path in modules().items()
        if package_of(name) == "_interfaces" and "rosidl_generator_c" in path.read_text("utf-8")
    }
    assert found == {"_interfaces.generators"}
    users = [name for name in modules() if imports_package(name, "rclpy")]
    assert not [name for name in users if package_of(name) == "_interfaces"]


# --- purpose and cost --------------------------------------------------------------------------


def test_every_module_says_what_it_is_for() -> None:
    for name, path in modules().items():
        assert ast.get_docstring(ast.parse(path.read_text("utf-8"))), name


def test_every_workaround_says_when_it_can_be_deleted() -> None:
    below = {name: path for name, path in modules().items() if name.startswith("_ros.workarounds.")}
    assert below
    for name, path in below.items():
        said = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
        assert "can be deleted when" in said, name


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
    "py_trees",
    "PIL",
    "mcp",
    "pydantic",
    "pydantic_core",
)


@pytest.mark.parametrize(
    "module",
    [
        "actionkit",
        "actionkit.agents",
        "actionkit.agents._mcp.stdio",  # standard output is taken before anything may print
        "actionkit.cli",
        "actionkit.testing.plugin",
    ],
)
def test_importing_is_light(module: str) -> None:
    allowed = {"pytest"} if "plugin" in module else set()
    code = f"import sys, {module}; print(*[m for m in {HEAVY} if m in sys.modules])"
    run = [sys.executable, "-W", "error", "-c", code]
    out = subprocess.run(run, capture_output=True, text=True, timeout=60, check=True).stdout
    assert set(out.split()) <= allowed
