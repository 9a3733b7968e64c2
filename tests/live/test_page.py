"""The page in a browser: it moves, breaks and records what the server runs."""

import json
import subprocess
import sys

import pytest

from tests.live.browser import browser, needs_browser, opened, press, until
from tests.live.serving import bench

pytestmark = needs_browser
ACTUATORS = ["torino-rotary", "nasa-ballscrew", "pisa-landing-gear"]
SLIDE = """([name, value]) => {
  const slider = document.querySelector(`.slider[data-name="${name}"] input[type=number]`);
  slider.value = value;
  slider.dispatchEvent(new Event("change"));
}"""


@pytest.mark.long
@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("width", [390, 820, 1280])
def test_the_page_fits_its_width(actuator, width, tmp_path):
    with bench(actuator, "--fidelity", "low", folder=tmp_path) as live, browser() as run:
        page, complaints = opened(run, live, viewport={"width": width, "height": 900})
        for tab in range(5):
            press(page, f"#tab-{tab}")
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        unnamed = page.evaluate("""[...document.querySelectorAll("input, select, textarea, button")]
            .filter(node => !node.labels?.length && !node.getAttribute("aria-label")
                            && !node.textContent.trim()).map(node => node.outerHTML)""")
        assert unnamed == []
        assert complaints == []


@pytest.mark.long
def test_backlash_is_named_and_the_recording_says_the_same(tmp_path):
    with bench("torino-rotary", folder=tmp_path) as live, browser() as run:
        page, complaints = opened(run, live)
        press(page, "#run")
        live.until(lambda state: state["health"]["status"] == "healthy")
        page.evaluate(SLIDE, ["backlash@transmission", "0.5"])
        begun = live.until(lambda state: state["injected"])["time"]
        named = live.until(lambda state: _names_backlash(state["health"]))
        assert named["health"]["stretch"][1] - begun < 20.0
        until(page, "document.querySelector('#causes').textContent.includes('backlash@')")
        press(page, "#record")
        begin = live.until(lambda state: state["recording"])["time"]
        live.until(lambda state: state["time"] > begin + 12.0)
        press(page, "#record-stop")
        live.until(lambda state: state["files"])
        strip = live.until(lambda state: _names_backlash(state["health"]))["health"]
        assert complaints == []
    (log,) = tmp_path.glob("*.csv")
    words = ["-m", "elevon", "diagnose", str(log), "--actuator", "torino-rotary", "--json"]
    answer = json.loads(
        subprocess.run([sys.executable, *words], capture_output=True, text=True, check=True).stdout
    )
    assert answer["status"] == strip["status"] == "faulty"
    assert answer["best"]["faults"] == ["backlash@transmission"]
    low, high = answer["faults"][0]["interval"]
    assert low <= strip["faults"][0]["severity"] <= high


def _names_backlash(health):
    return any(
        fault["kind"] == "backlash" and fault["probability"] > 0.9 for fault in health["faults"]
    )


@pytest.mark.long
def test_two_viewers_one_in_control(tmp_path):
    with bench("--fidelity", "low", folder=tmp_path) as live, browser() as run:
        first, _ = opened(run, live)
        second, _ = opened(run, live)
        press(first, "#run")
        until(first, "elevonPage.state.mine")
        press(second, "#stop")
        until(second, "document.querySelector('#message').textContent.includes('control')")
        assert live.state()["panel"]["moving"]
        first.close()
        live.until(lambda state: not state["control"]["held"])
        press(second, "#stop")
        live.until(lambda state: not state["panel"]["moving"])


@pytest.mark.long
def test_a_link_does_again_what_was_done(tmp_path):
    with bench("--fidelity", "low", folder=tmp_path) as live, browser() as run:
        page, _ = opened(run, live)
        press(page, "#run")
        page.evaluate(SLIDE, ["friction@transmission", "0.5"])
        live.until(lambda state: state["injected"])
        press(page, "#link")
        until(page, "location.hash.startsWith('#do=')")
        live.act(
            {"X-Viewer": page.evaluate("elevonPage.source.viewer")},
            fault={"friction@transmission": 0},
            panel="stop",
        )
        press(page, "#linked")
        live.until(lambda state: state["injected"] and state["panel"]["moving"])


@pytest.mark.long
def test_a_recorded_session_runs_without_a_server(tmp_path):
    from elevon.cli import main

    assert main(["live", "--fidelity", "low", "--static", str(tmp_path / "page")]) == 0
    with browser() as run:
        page = run.new_page()
        complaints = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((tmp_path / "page" / "index.html").as_uri())
        until(page, "window.elevonPage?.frames > 5")
        until(page, "document.querySelector('#verdict').textContent === 'FAULTY'")
        assert complaints == []
