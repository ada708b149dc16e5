"""Machine status for Prometheus: checked by promtool, and by a real server with a rule."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import socket
import subprocess
import time
from contextlib import closing, suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.screen import DashboardServer

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
PROMETHEUS, PROMTOOL = shutil.which("prometheus"), shutil.which("promtool")
pytestmark = pytest.mark.skipif(
    not (PROMETHEUS and PROMTOOL) and "CI" not in os.environ, reason="prometheus is not installed"
)
PAGE = Path(__file__).parents[3] / "docs" / "alarms.md"
RULES = re.findall(r"^```yaml\n(groups:.*?)^```", PAGE.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)[0]
CONFIG = """
global: {{scrape_interval: 1s, evaluation_interval: 1s}}
rule_files: [rules.yml]
scrape_configs:
  - job_name: lobewatch
    authorization: {{credentials: "{token}"}}
    static_configs: [{{targets: ["{target}"]}}]
"""


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """One fallen by 12 %, with a name that needs care, and one never tapped."""
    shop.put("")
    shutil.copytree(shop.path, tmp_path / "mills" / "new")
    shop.edit('name = "m"', 'name = "five \\\\ axes, \\"big\\""')
    days = (datetime.now(shop.start.tzinfo) - shop.start) / timedelta(days=1)
    shop.tap_both(days - 40)
    shop.tap_both(days - 2, 0.88)
    shutil.copytree(shop.path, tmp_path / "mills" / "worn")
    return tmp_path / "mills"


def test_promtool_finds_nothing_wrong_with_what_status_writes(mills: Path) -> None:
    told = CliRunner().invoke(app, ["status", str(mills), "--prometheus", str(mills / "mills.prom")])
    assert told.exit_code == 1
    text = (mills / "mills.prom").read_text("utf-8")
    checked = subprocess.run(
        [str(PROMTOOL), "check", "metrics"], input=text, text=True, capture_output=True, check=False
    )
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")
    worn = r'{folder="worn",machine="five \\ axes, \"big\""'
    assert f'lobewatch_light{worn},light="alarm"}} 1.0\n' in text
    assert f'lobewatch_light{worn},light="good"}} 0.0\n' in text
    (fall,) = (
        line for line in text.splitlines() if line.startswith("lobewatch_frequency_fall_ratio") and '"x"' in line
    )
    assert float(fall.rpartition(" ")[2]) == pytest.approx(0.12, abs=1e-3)
    assert '{folder="new",machine="m",code="never-tapped"} 1.0' in text


def test_a_real_prometheus_reads_the_server_and_fires_a_rule(mills: Path, tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    (tmp_path / "rules.yml").write_text(RULES, "utf-8")
    with DashboardServer(mills) as server:
        told = CONFIG.format(token=server.watch_token, target=server.origin.removeprefix("http://"))
        (tmp_path / "prometheus.yml").write_text(told, "utf-8")
        command = [str(PROMETHEUS), f"--config.file={tmp_path}/prometheus.yml", f"--storage.tsdb.path={tmp_path}/data"]
        command.append(f"--web.listen-address=127.0.0.1:{port}")
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        try:
            alerts = wait_for_alerts(port)
        finally:
            process.kill()
            process.wait()
    assert ("firing", "SpindleAlarm", "worn") in [
        (one["state"], one["labels"]["alertname"], one["labels"].get("folder")) for one in alerts
    ]
    assert {one["labels"]["folder"] for one in alerts if one["state"] == "firing"} == {"worn"}


def wait_for_alerts(port: int) -> list[dict[str, Any]]:
    for _ in range(300):
        with (
            suppress(OSError, ValueError, http.client.HTTPException),
            closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection,
        ):
            connection.request("GET", "/api/v1/alerts")
            with connection.getresponse() as answer:
                alerts: list[dict[str, Any]] = json.load(answer)["data"]["alerts"]
            if any(alert["state"] == "firing" for alert in alerts):
                return alerts
        time.sleep(0.2)
    return []
