"""The security settings of ROS 2 (SROS 2), as rcl reads them. It only looks for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_FILES = (
    *("identity_ca.cert.pem", "permissions_ca.cert.pem", "cert.pem", "key.pem"),
    *("governance.p7s", "permissions.p7s"),
)
"""What an enclave needs. All but the last two may also be `.p11`: a key outside of the disk."""
ON = "ROS_SECURITY_ENABLE"
STRATEGY = "ROS_SECURITY_STRATEGY"
KEYSTORE = "ROS_SECURITY_KEYSTORE"
OVERRIDE = "ROS_SECURITY_ENCLAVE_OVERRIDE"


@dataclass(frozen=True)
class Security:
    """The settings of a process in which security is on."""

    enforced: bool
    """Whether nothing works without the files; else it goes on without security."""
    keystore: str
    """The folder; "" where none is named."""
    enclave: str
    """The name of the enclave, such as `/robot/client`."""

    @property
    def folder(self) -> Path:
        """Where the files of the enclave have to be."""
        return Path(self.keystore) / "enclaves" / self.enclave.lstrip("/")

    def missing(self) -> list[str]:
        """Return the names of the files that are not there."""
        return [name for name in _FILES if not self._has(name)]

    @property
    def in_force(self) -> bool:
        """Whether nothing works without keys; where it is not enforced, only with all files."""
        return self.enforced or not self.problem()

    def problem(self) -> str:
        """Return what is wrong with the files, as a sentence; "" if nothing is."""
        if not self.keystore:
            return f"{KEYSTORE} does not name the folder with the keys."
        if not self.folder.is_dir():
            return f"The folder {self.folder} is not there."
        if missing := self.missing():
            return f"The folder {self.folder} lacks {', '.join(missing)}."
        return ""

    def _has(self, name: str) -> bool:
        path = self.folder / name
        return path.is_file() or (path.suffix == ".pem" and path.with_suffix(".p11").is_file())


def security(environment: Mapping[str, str], arguments: Sequence[str]) -> Security | None:
    """Return the settings of a process with these arguments; `None` where security is off."""
    if environment.get(ON) != "true":
        return None
    enclave = environment.get(OVERRIDE) or _enclave(arguments) or "/"
    enforced = environment.get(STRATEGY) == "Enforce"
    return Security(enforced, environment.get(KEYSTORE, ""), enclave)


def _enclave(arguments: Sequence[str]) -> str:
    """Return what follows `--enclave` or `-e` among the arguments for ROS; "" if nothing does."""
    for_ros = False
    for word, following in zip(arguments, [*arguments[1:], ""], strict=False):
        if word in ("--ros-args", "--"):
            for_ros = word == "--ros-args"
        elif for_ros and word in ("--enclave", "-e"):
            return following
    return ""
