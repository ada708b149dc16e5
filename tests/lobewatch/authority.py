"""An authority of one's own, made with openssl."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest


class Certificates(NamedTuple):
    """Files in PEM."""

    authority: Path
    certificate: Path
    key: Path


def certify(folder: Path, names: str) -> Certificates:
    """Make a new authority and its certificate for these names. Skip the test without openssl."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    folder.mkdir()
    (folder / "names").write_text(f"subjectAltName={names}")
    new_key = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
    for arguments in (
        f"req -x509 {new_key} -keyout ca.key -out ca.pem -subj /CN=Plant",
        f"req {new_key} -keyout key.pem -out request.pem -subj /CN=Computer",
        "x509 -req -in request.pem -CA ca.pem -CAkey ca.key -CAcreateserial -extfile names -out certificate.pem",
    ):
        subprocess.run(["openssl", *arguments.split()], cwd=folder, check=True, capture_output=True)
    return Certificates(folder / "ca.pem", folder / "certificate.pem", folder / "key.pem")
