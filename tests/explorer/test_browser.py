"""Explorer in a real browser: a key moves a slider, and the time until the picture follows."""

import os
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest

from jbeamshell.measured.example import data_folder
from jbeamshell.scene.toml import read_scene

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
pytest.importorskip("panel", reason="the explorer needs panel: pip install 'jbeamshell[explore]'")
psutil = pytest.importorskip("psutil")
webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium: pip install selenium")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (BROWSER and DRIVER), reason="needs a browser: apt-get install chromium chromium-driver"
    ),
]

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update", "--disable-quic"]
MOVES = 9
SOON = 100.0  # milliseconds of work from a key to the picture; on an idle machine, of the clock too
# Elements of all shadow roots below the document.
DEEP = """
const found = [];
const look = (root) => {
  found.push(...root.querySelectorAll(arguments[0]));
  root.querySelectorAll('*').forEach((e) => e.shadowRoot && look(e.shadowRoot));
};
look(document);
"""
TEXTS = DEEP + "return found.map((e) => e.textContent);"
DEEP += "return found;"
CLOCK = """
window.moves = [];
document.addEventListener('keydown', () => { window.pressed = performance.now(); }, true);
const source = Bokeh.documents[0].get_model_by_name('loop');
source.properties.data.change.connect(() => requestAnimationFrame(() => requestAnimationFrame(
  () => window.moves.push(performance.now() - window.pressed))));
"""
FORCE = "return Array.from(Bokeh.documents[0].get_model_by_name(arguments[0]).data[arguments[1]])"


@pytest.fixture(scope="module")
def server():
    """Explorer in a process of its own."""
    command = [sys.executable, "-m", "jbeamshell", "explore", "standard", "--no-browser"]
    env = {k: v for k, v in os.environ.items() if k != "JAX_DISABLE_MOST_OPTIMIZATIONS"}
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env)
    yield server
    server.terminate()
    server.communicate(timeout=60.0)


@pytest.fixture(scope="module")
def address(server):
    return server.stdout.readline().strip()


@pytest.fixture(scope="module")
def page(address, tmp_path_factory):
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    folder = tmp_path_factory.mktemp("browser")
    for flag in [*FLAGS, "--window-size=1400,1000", f"--user-data-dir={folder}"]:
        options.add_argument(flag)
    options.add_experimental_option("prefs", {"download.default_directory": str(folder)})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.folder = folder
    driver.get(address)
    until(
        lambda: len(deep(driver, ".noUi-handle")) >= 5 and driver.execute_script(FORCE, "loop", "F")
    )
    yield driver
    driver.quit()


def deep(driver, selector):
    return driver.execute_script(DEEP, selector)


def until(holds, seconds=60.0):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def words(driver, selector="p[role]"):
    return " ".join(driver.execute_script(TEXTS, selector))


def press(driver, key):
    webdriver.ActionChains(driver).send_keys(key).perform()


def test_it_serves_this_machine_only(address):
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)


def test_a_key_on_a_slider_moves_the_loop_after_a_tenth_of_a_second_of_work(page, server):
    page.execute_script(CLOCK)
    friction = deep(page, ".noUi-handle")[1]
    friction.click()
    seen, work = [], []
    for _ in range(MOVES):
        time.sleep(0.3)  # until the move before is over
        page.execute_script("moves.length = 0")
        before, begin = page.execute_script(FORCE, "loop", "u"), processor_time(server)
        press(page, webdriver.Keys.ARROW_RIGHT)
        until(lambda old=before: page.execute_script(FORCE, "loop", "u") != old)
        until(lambda: page.execute_script("return moves"))
        work.append(1e3 * (processor_time(server) - begin))
        seen += page.execute_script("return moves")
    until(lambda: "computed in" in words(page))
    print(f"key to picture {np.round(seen)} ms, {np.round(work)} of work; {words(page)}")
    assert len(seen) == MOVES  # one picture for each
    assert np.quantile(work, 0.25) < SOON  # a busy machine spoils some


def processor_time(process):
    """Seconds that a process has worked, which other work on the machine does not change."""
    times = psutil.Process(process.pid).cpu_times()
    return times.user + times.system


def test_a_file_is_drawn_and_the_scene_is_taken_away(page):
    next(b for b in deep(page, "button") if b.text == "Reset").click()
    time.sleep(1.0)  # until the sliders that another test moved are back
    file = data_folder() / "loops_eta0.1126.csv"
    deep(page, "input[type=file]")[0].send_keys(str(file))
    until(lambda: len(page.execute_script(FORCE, "measured", "F")) > 100)
    assert file.name in words(page)
    link = next(a for a in deep(page, "a, button") if "scene.toml" in a.text)
    link.click()
    until(lambda: (page.folder / "scene.toml").exists())
    assert float(read_scene(page.folder / "scene.toml").contact.friction) == 0.1


def test_another_scene_has_its_own_sliders(page):
    choice = deep(page, "select")[0]
    choice.click()
    next(o for o in deep(page, "option") if o.text == "single-lap").click()
    until(lambda: len(deep(page, ".noUi-handle")) == 7)
    until(lambda: words(page) and "preparing" not in words(page), 180.0)
    assert "Bolt: place X" in words(page, "div")
    errors = [line for line in page.get_log("browser") if line["level"] == "SEVERE"]
    assert not errors


def test_a_phone_sees_the_page_as_wide_as_it_is(page, address):
    phone = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    page.get(address)
    until(lambda: len(deep(page, ".noUi-handle")) >= 5 and len(deep(page, "canvas")) >= 4)
    assert page.execute_script("return document.documentElement.scrollWidth") == 390
    boxes = [e.rect for e in deep(page, "canvas")]
    assert all(box["x"] + box["width"] <= 390 for box in boxes)
