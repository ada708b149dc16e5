"""Pictures of the docs, from real runs: `.venv/bin/python docs/make_pictures.py` (needs chromium and chromedriver).

An emulated device is tapped as a technician would, and a browser looks at each state; the demo gives lobes and model.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

IMAGES = Path(__file__).with_name("images")
SIZE = (1280, 657)
STATES = {
    "screen-ask": "SPINDLE STOPPED?",
    "screen-checking": "CHECKING",
    "screen-tap": "TAP",
    "screen": "GOOD",
    "screen-refused": "DOUBLE HIT",
    "screen-move": "MOVE SENSOR",
    "screen-done": "DONE",
}
"""Name of each picture, and the word that stands in large letters then."""


def lobewatch(*words: object) -> list[str]:
    """Return the command line of a lobewatch command."""
    return [sys.executable, "-u", "-m", "lobewatch.cli", *map(str, words)]


@contextmanager
def running(*words: object) -> Iterator[subprocess.Popen[str]]:
    """Run a command and end it afterwards; stderr goes to stdout."""
    with subprocess.Popen(
        lobewatch(*words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def first_match(process: subprocess.Popen[str], pattern: str) -> str:
    """Return the first group of a pattern in the output of a command."""
    assert process.stdout is not None
    for line in process.stdout:
        if match := re.search(pattern, line):
            return match[1]
    raise RuntimeError(f"nothing said {pattern}")


def browser() -> webdriver.Chrome:
    """Chromium without a window."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    metrics = {"width": SIZE[0], "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    return driver


def screens(folder: Path, driver: webdriver.Chrome) -> None:
    """Run a tap test in x and y, and save a picture of each state."""
    machine = folder / "mill-3"
    subprocess.run(lobewatch("init", machine, "--example"), check=True, stdout=subprocess.DEVNULL)
    with running("emulate", "taps", machine, "--json") as device:
        port = first_match(device, r'"port": "([^"]+)"')
        with running("tap", machine, "--port", port, "--screen") as test:
            driver.get(first_match(test, r"^screen: (\S+)"))
            left = dict(STATES)
            while left:
                name = WebDriverWait(driver, 90, 0.02).until(lambda _, left=left: state_of(driver, left))
                driver.save_screenshot(str(IMAGES / f"{name}.png"))
                del left[name]
                if name == "screen-ask":
                    driver.find_element(By.CSS_SELECTOR, "#choices button").click()
                if name == "screen-move":
                    driver.find_element(By.XPATH, "//button[contains(., 'tap y')]").click()


def state_of(driver: webdriver.Chrome, left: dict[str, str]) -> str | None:
    """Return the name of a missing picture that the page shows now: GOOD at hit 7, DONE with the result of y."""
    word = driver.find_element(By.ID, "text").text
    if word == "GOOD" and driver.find_element(By.ID, "good").text != "7":
        return None
    if word == "DONE" and ("screen-move" in left or not driver.find_element(By.ID, "next").text):
        return None
    return next((name for name, wanted in left.items() if wanted == word), None)


def of_the_demo(folder: Path, driver: webdriver.Chrome) -> None:
    """Lobes, model, and the first screen of the report."""
    demo = folder / "lobewatch-demo"
    subprocess.run(lobewatch("demo", "--out", demo), check=True, stdout=subprocess.DEVNULL)
    for name in ("lobes", "model"):
        subprocess.run(lobewatch(name, demo, "--figure", IMAGES / f"{name}.png"), check=True, stdout=subprocess.DEVNULL)
    driver.get((demo / "report.html").as_uri())
    driver.save_screenshot(str(IMAGES / "report.png"))


def main() -> None:
    """All of them."""
    with tempfile.TemporaryDirectory() as folder:
        driver = browser()
        try:
            screens(Path(folder), driver)
            of_the_demo(Path(folder), driver)
        finally:
            driver.quit()
    print(json.dumps(sorted(path.name for path in IMAGES.glob("*.png"))))  # noqa: T201


if __name__ == "__main__":
    main()
