"""Broker with a certificate of the factory's own authority, as in docs/alarms.md."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.lobewatch.authority import certify
from tests.lobewatch.notify.conftest import Mosquitto, machine, received, started


@pytest.fixture
def authority(tmp_path: Path, mosquitto: Mosquitto) -> Path:
    """Certificate of the authority; the broker has one by it, for its address and the name broker.example."""
    made = certify(tmp_path / "certificates", "DNS:broker.example,IP:127.0.0.1")
    mosquitto.start(more=[f"certfile {made.certificate}", f"keyfile {made.key}"])
    return made.authority


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
