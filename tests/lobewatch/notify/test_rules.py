"""The rules of docs/alarms.md on recorded series, by promtool: what fires, and what goes on where all falls silent."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[3] / "docs" / "alarms.md").read_text("utf-8")
PROMTOOL = shutil.which("promtool", path=f"{os.environ['PATH']}:/usr/sbin:/usr/local/sbin")
(RULES,) = (block for block in re.findall(r"^```yaml\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE) if "groups:" in block)
ALERTS = re.findall(r"alert: (\w+)", RULES)
MILL = 'folder="m", machine="mill"'


def series(name: str, values: str, labels: str = MILL) -> str:
    return f"      - {{series: '{name}{{{labels}}}', values: '{values}'}}\n"


HEALTHY = {
    "lobewatch_up": "1x300",
    "lobewatch_light": "0x300",
    "lobewatch_alarms": "0x300",
    "lobewatch_alarms_acknowledged": "0x300",
    "lobewatch_can_be_judged": "1x300",
    "lobewatch_judged_timestamp_seconds": "0+300x300",
}
"""A day and an hour, a value every 5 minutes."""
CASES: dict[str, tuple[dict[str, str], set[str]]] = {
    "all is well": ({}, set()),
    "on alarm": ({"lobewatch_light": "0x9 1x290", "lobewatch_alarms": "0x9 1x290"}, {"SpindleAlarm"}),
    "acknowledged": (
        {"lobewatch_light": "1x300", "lobewatch_alarms": "2x300", "lobewatch_alarms_acknowledged": "1x99 2x200"},
        {"SpindleAlarm", "SpindleAlarmAcknowledged"},
    ),
    "one of two acknowledged": (
        {"lobewatch_light": "1x300", "lobewatch_alarms": "2x300", "lobewatch_alarms_acknowledged": "1x300"},
        {"SpindleAlarm"},
    ),
    "on alarm, then the server was killed": (
        {name: values.replace("x300", "x20 stale") for name, values in HEALTHY.items()}
        | {"lobewatch_light": "1x20 stale", "lobewatch_alarms": "1x20 stale"},
        {"SpindleAlarm", "LobewatchSilent"},
    ),
    "files torn": ({"lobewatch_can_be_judged": "1x9 0x290"}, {"SpindleCannotBeJudged"}),
    "judging has stopped": ({"lobewatch_judged_timestamp_seconds": "-172800x300"}, {"JudgementOld"}),
}


@pytest.mark.skipif(PROMTOOL is None and not os.environ.get("CI"), reason="promtool is not installed")
@pytest.mark.parametrize("name", CASES)
def test_the_rules_fire_for_what_they_are_named_after(name: str, tmp_path: Path) -> None:
    altered, expected = CASES[name]
    lines = ["rule_files: [rules.yml]\nevaluation_interval: 5m\ntests:\n  - interval: 5m\n    input_series:\n"]
    for family, values in (HEALTHY | altered).items():
        labels = "" if family == "lobewatch_up" else MILL + (', light="alarm"' if family == "lobewatch_light" else "")
        lines.append(series(family, values, labels))
    lines.append("    promql_expr_test:\n")
    for alert in ALERTS:
        samples = f"[{{labels: 'ALERTS{{alertname=\"{alert}\"}}', value: 1}}]" if alert in expected else "[]"
        expression = f'sum by (__name__, alertname) (ALERTS{{alertname="{alert}", alertstate="firing"}})'
        lines.append(f"      - {{expr: '{expression}', eval_time: 24h, exp_samples: {samples}}}\n")
    (tmp_path / "rules.yml").write_text(RULES, "utf-8")
    (tmp_path / "test.yml").write_text("".join(lines), "utf-8")
    command = [str(PROMTOOL), "test", "rules", "test.yml"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stdout + said.stderr
