"""All clients that are measured, by name."""

from __future__ import annotations

from benchmarks.bridges import SpinningTask, SpinningThread
from benchmarks.clients import (
    FLOOR,
    KEYS,
    LEDGER,
    MANY_KEYS,
    Awaiting,
    Blocking,
    MultiThreaded,
    OneThread,
    Tutorial,
    WithKeys,
    WithLedger,
    WithManyKeys,
)
from benchmarks.floor import Floor
from benchmarks.rclcpp_client import Rclcpp, prefix
from benchmarks.variant import Variant

VARIANTS: dict[str, type[Variant]] = {
    "ActionKit blocking": Blocking,
    "ActionKit await": Awaiting,
    FLOOR: Floor,
    "rclpy tutorial": Tutorial,
    "rclpy one thread": OneThread,
    "rclpy multi-threaded": MultiThreaded,
    "asyncio, spin_once": SpinningTask,
    "asyncio, run_in_executor": SpinningThread,
}
if prefix() is not None:
    VARIANTS["rclcpp"] = Rclcpp
COMPARED = tuple(VARIANTS)
"""Those that are compared with each other."""
VARIANTS[LEDGER] = WithLedger
VARIANTS[KEYS], VARIANTS[MANY_KEYS] = WithKeys, WithManyKeys
RAW = tuple(name for name in VARIANTS if name.startswith(("rclpy", "asyncio")))
