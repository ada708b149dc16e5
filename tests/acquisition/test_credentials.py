"""Passwords in addresses are hidden from texts, and from the arguments that other users can read."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import quote

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.credentials import hide_arguments, hide_passwords, restore_password, split_password

SECRET = "quite-secret"
passwords = st.text(
    st.characters(codec="ascii", categories=("L", "N", "P", "S"), exclude_characters="\"'<>"), min_size=1
)


@given(st.sampled_from(["mqtt", "mqtts", "postgresql", "postgres", "HTTPS"]), passwords)
def test_no_password_stays_in_a_text(scheme: str, password: str) -> None:
    shown = hide_passwords(f"no answer of {scheme}://mill:{password}@h.example:17/plant (refused)")
    assert shown == f"no answer of {scheme}://mill@h.example:17/plant (refused)"


@settings(max_examples=30)
@given(st.text(min_size=1, max_size=20))
def test_a_split_address_has_its_decoded_password(password: str) -> None:
    address = f"postgresql://mill:{quote(password, safe='')}@h/db?sslmode=require"
    assert split_password(address) == ("postgresql://mill@h/db?sslmode=require", password)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "socket://10.0.0.5:5025",
        "mqtt://mill@h/plant",
        "postgresql://h/db",
        "note: tap it at 10:30, then write to a@b.example",
        "feed = 0.1 # a: b@c",
        "C:/data/mill@home",
    ],
)
def test_texts_without_a_password_stay(text: str) -> None:
    assert hide_passwords(text) == text


@pytest.mark.parametrize(
    "text",
    [f"postgresql://h/db?user=u&password={SECRET}", f"host=h password={SECRET}", f"postgresql:/u:{SECRET}@h/db"],
)
def test_other_forms_of_addresses_hide_it(text: str) -> None:
    assert SECRET not in hide_passwords(text)


def test_an_argument_is_hidden_and_given_back_where_it_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    given_address = f"postgresql://u:{SECRET}@h/db"
    monkeypatch.setattr(sys, "argv", ["lobewatch", "export", "mills", "--to", given_address, f"--to={given_address}"])
    hide_arguments()
    assert SECRET not in "".join(sys.argv)
    assert restore_password(sys.argv[4]) == given_address
    assert restore_password("postgresql://v@h/db") == "postgresql://v@h/db"


@pytest.mark.skipif(sys.platform != "linux", reason="no /proc")
def test_the_process_title_has_no_password(tmp_path: Path) -> None:
    (tmp_path / "mill").mkdir()
    (tmp_path / "mill" / "machine.toml").write_text("", encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"postgresql://mill:{SECRET}@127.0.0.1:{server.getsockname()[1]}/db"
        command = [sys.executable, "-m", "lobewatch", "export", str(tmp_path), "--to", address]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            server.settimeout(60.0)
            connection, _ = server.accept()
            title = Path(f"/proc/{process.pid}/cmdline").read_text(encoding="utf-8")
            connection.close()
            said = "".join(process.communicate(timeout=60))
    assert SECRET not in title
    assert "postgresql://mill@127.0.0.1" in title
    assert SECRET not in said
    assert process.returncode == 2


@pytest.mark.parametrize("piece", ["a.b-", "a://b:", "password=", "a://"])
def test_a_text_made_to_be_slow_is_not(piece: str) -> None:
    begin = time.process_time()
    hide_passwords(piece * 20_000 + ":/")
    assert time.process_time() - begin < 2.0
