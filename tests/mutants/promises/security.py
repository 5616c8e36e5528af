"""Mutants of calls on a secured graph."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C13.2",
        "what security forbids is an error of rcl's",
        "_ros/communication/own_node.py",
        '        if "SECURITY ERROR" in text:\n            raise_if_secured(error, own=True)\n',
        "",
        ("client/test_security.py::test_what_is_missing_is_told",),
    ),
    Mutant(
        "C13.2",
        "the error of a middleware that has no security does not say so",
        "_ros/communication/secured.py",
        "            raise_if_secured(error, own=own)\n",
        "            pass\n",
        ("client/test_security.py::test_what_is_missing_is_told",),
    ),
    Mutant(
        "C13.2",
        "the error does not say which files are missing",
        "_ros/communication/secured.py",
        '        where += f" {settings.problem()}" if settings.problem() else ""\n',
        "",
        ("client/test_security.py::test_what_is_missing_is_told",),
    ),
    Mutant(
        "C13.2",
        "the enclave of the command line is taken before that of the environment",
        "_model/environment/security.py",
        '    enclave = environment.get(OVERRIDE) or _enclave(arguments) or "/"\n',
        '    enclave = _enclave(arguments) or environment.get(OVERRIDE) or "/"\n',
        ("client/test_security.py::test_the_settings_are_read_as_rcl_reads_them",),
    ),
    Mutant(
        "C13.2",
        "a key outside of the disk counts as missing",
        "_model/environment/security.py",
        "        return path.is_file() or (path.suffix",
        "        return path.is_file() and (path.suffix",
        ("client/test_security.py::test_a_key_may_be_outside_of_the_disk",),
    ),
    Mutant(
        "C13.2",
        "`doctor` takes security for enforced that is not",
        "cli/doctor/_settings.py",
        "    if not found.enforced:\n",
        "    if False:\n",
        ("cli/test_doctor.py::test_each_setting",),
    ),
)
