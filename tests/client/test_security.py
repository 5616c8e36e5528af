"""What ROS security forbids is told, on a middleware that has none. Contract C13.2."""

import pytest

from actionkit._model.environment.security import Security, security

FILES = (
    *("identity_ca.cert.pem", "permissions_ca.cert.pem", "cert.pem", "key.pem"),
    *("governance.p7s", "permissions.p7s"),
)
OPENS = """
from actionkit import Client, SecurityError
from test_msgs.action import Fibonacci
try:
    Client(Fibonacci, "fibonacci")
except SecurityError as error:
    print(error)
"""


@pytest.fixture
def keystore(tmp_path):
    """A keystore with the enclave /robot/client, with empty files."""
    folder = tmp_path / "keys" / "enclaves" / "robot" / "client"
    folder.mkdir(parents=True)
    for name in FILES:
        (folder / name).touch()
    return tmp_path / "keys"


@pytest.mark.parametrize(
    ("enclave", "told"),
    [
        ("/robot/other", "/keys/enclaves/robot/other is not there"),
        ("/robot", "/keys/enclaves/robot lacks identity_ca.cert.pem, permissions_ca.cert.pem"),
        ("/robot/client", "This Fast DDS version doesn't have the security libraries"),
    ],
)
@pytest.mark.every
def test_what_is_missing_is_told(enclave, told, keystore, run_script, monkeypatch):
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(keystore))
    monkeypatch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", enclave)
    code, out, _ = run_script(OPENS).finish()
    assert code == 0
    assert out.startswith("ROS security keeps this process out: ")
    assert f"It is enclave {enclave!r} of the keystore" in out
    assert told in out
    assert "`actionkit doctor` checks the settings" in out


@pytest.mark.parametrize(
    ("environment", "arguments", "found"),
    [
        ({}, [], None),
        ({"ROS_SECURITY_ENABLE": "True"}, [], None),  # rcl wants it in small letters
        ({"ROS_SECURITY_ENABLE": "true"}, [], Security(False, "", "/")),
        (
            {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"},
            ["x", "--enclave", "/no", "--ros-args", "-r", "a:=b", "-e", "/yes", "--", "-e", "/no"],
            Security(True, "", "/yes"),
        ),
        (
            {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_ENCLAVE_OVERRIDE": "/first"},
            ["--ros-args", "--enclave", "/second"],
            Security(False, "", "/first"),
        ),
        (
            {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_KEYSTORE": "/keys"},
            ["--ros-args", "--enclave", "/yes", "-e", "/no"],
            Security(False, "/keys", "/yes"),
        ),
        (
            {"ROS_SECURITY_ENABLE": "true"},
            ["-e", "/no", "--ros-args", "--", "-e", "/no", "--ros-args", "-e"],
            Security(False, "", "/"),
        ),
    ],
)
@pytest.mark.every
def test_the_settings_are_read_as_rcl_reads_them(environment, arguments, found):
    assert security(environment, arguments) == found


def test_a_key_may_be_outside_of_the_disk(keystore):
    found = Security(True, str(keystore), "/robot/client")
    assert found.problem() == ""
    (found.folder / "key.pem").rename(found.folder / "key.p11")
    assert found.problem() == ""
    (found.folder / "key.p11").unlink()
    assert found.problem() == f"The folder {found.folder} lacks key.pem."
    (found.folder / "cert.pem").unlink()
    assert found.problem() == f"The folder {found.folder} lacks cert.pem, key.pem."


def test_without_enforcement_it_is_in_force_only_with_all_files(keystore):
    for enforced in (False, True):
        assert Security(enforced, str(keystore), "/robot/client").in_force
        assert Security(enforced, str(keystore), "/robot/other").in_force is enforced
        nowhere = Security(enforced, "", "/Xavier/client")
        assert nowhere.in_force is enforced
        assert nowhere.problem() == "ROS_SECURITY_KEYSTORE does not name the folder with the keys."
        assert str(nowhere.folder) == "enclaves/Xavier/client"
