#!/usr/bin/env python3
"""Runs the tests in this folder in a virtual environment that it makes.

`cargo xtask interop` calls it. By hand, `tests/interop/run.py test_drives` runs
one file; what follows is passed on to unittest.
"""

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ENVIRONMENT = HERE.parents[1] / "target" / "interop"
REQUIREMENTS = HERE / "requirements.txt"
# Holds what was installed, once it is complete.
STAMP = ENVIRONMENT / "installed"


def python():
    """The environment's interpreter."""
    if os.name == "nt":
        return ENVIRONMENT / "Scripts" / "python.exe"
    return ENVIRONMENT / "bin" / "python"


def prepare():
    """Makes the environment, unless it is there already."""
    wanted = f"{sys.version} {hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()}"
    if STAMP.exists() and STAMP.read_text() == wanted:
        return
    venv.create(ENVIRONMENT, clear=True, with_pip=True)
    subprocess.run(
        [python(), "-m", "pip", "--quiet", "--disable-pip-version-check"]
        + ["install", "--requirement", REQUIREMENTS],
        check=True,
    )
    STAMP.write_text(wanted)


def main():
    prepare()
    what = sys.argv[1:] or ["discover"]
    tests = [python(), "-m", "unittest", *what, "--verbose"]
    sys.exit(subprocess.run(tests, cwd=HERE).returncode)


if __name__ == "__main__":
    main()
