"""A broker whose certificate is of the plant's own authority, as docs/alarms.md says."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.lobewatch.notify.conftest import Mosquitto, machine, received, started

NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


def openssl(folder: Path, *arguments: str) -> None:
    subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def authority(tmp_path: Path, mosquitto: Mosquitto) -> Path:
    """Certificate of the authority; the broker has one by it, for its address and the name broker.example."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    where = tmp_path / "certificates"
    where.mkdir()
    openssl(where, "req", "-x509", *NEW_KEY, "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=Plant")
    openssl(where, "req", *NEW_KEY, "-keyout", "broker.key", "-out", "broker.csr", "-subj", "/CN=broker.example")
    (where / "names").write_text("subjectAltName=DNS:broker.example,IP:127.0.0.1")
    by = ("-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-extfile", "names")
    openssl(where, "x509", "-req", "-in", "broker.csr", *by, "-out", "broker.pem")
    mosquitto.start(more=[f"certfile {where / 'broker.pem'}", f"keyfile {where / 'broker.key'}"])
    return where / "ca.pem"


def test_ssl_cert_file_names_the_authority(
    tmp_path: Path, mosquitto: Mosquitto, authority: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mill = machine(tmp_path / "a", mosquitto.address.replace("mqtt:", "mqtts:"))
    refusal = "cannot be reached ([SSL: CERTIFICATE_VERIFY_FAILED]"
    assert refusal in started("event", mill, "oiled").stderr
    assert (mill / "unsent.json").exists()
    monkeypatch.setenv("SSL_CERT_FILE", str(authority))
    assert started("event", mill, "oiled").stderr == ""
    message = received(mosquitto, "lobewatch/a/standing", tls={"ca_certs": str(authority)})
    assert json.loads(message.payload)["machine"] == "a"
    by_name = machine(tmp_path / "b", f"mqtts://localhost:{mosquitto.port}")
    assert refusal in started("event", by_name, "oiled").stderr
