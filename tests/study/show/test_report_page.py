"""The report in a browser: opens without a complaint, draws, keeps scripts from elsewhere out, fits a phone, prints."""

import base64
import json
import os
import re
import shutil
import subprocess
import time
from contextlib import closing

import h5py
import pytest

from softjaw.study.cli import main
from tests.study import view_files
from tests.study.formula_results import sealed

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WORDS = "--headless=new --no-sandbox --disable-dev-shm-usage --remote-debugging-pipe --hide-scrollbars"
WORDS += " --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"  # WebGL without a graphics card
pytestmark = [pytest.mark.long, pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine")]
REASON = "</script> convergence <b>lost</b>"


class Browser:
    """One page in Chromium without a window, driven through a pair of pipes.

    ``told`` collects the events of the page, with their values as JSON.
    """

    def __init__(self, profile):
        there, self._write = os.pipe()
        self._read, back = os.pipe()

        def pipes():  # the browser reads from 3 and writes to 4
            one, two = os.dup(there), os.dup(back)
            os.dup2(one, 3)
            os.dup2(two, 4)

        self._process = subprocess.Popen(
            [str(PROGRAM), *WORDS.split(), f"--user-data-dir={profile}", "about:blank"],
            preexec_fn=pipes, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(there)
        os.close(back)
        self._rest, self._number, self._session, self.told = b"", 0, {}, []
        page = next(t for t in self.do("Target.getTargets")["targetInfos"] if t["type"] == "page")
        session = self.do("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        self._session = {"sessionId": session}
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{domain}.enable")

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def do(self, method, **values):
        self._number += 1
        message = {"id": self._number, "method": method, "params": values, **self._session}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            pass
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def _next(self):
        while b"\0" not in self._rest:
            chunk = os.read(self._read, 1 << 20)
            assert chunk, "the browser ended"
            self._rest += chunk
        text, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(text)
        self.told.append((message.get("method"), json.dumps(message.get("params"))))
        return message

    def open(self, path, width=1100, height=800, *, phone=False):
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        self.do("Emulation.setTouchEmulationEnabled", enabled=phone)
        self.do("Emulation.setFocusEmulationEnabled", enabled=True)
        self.told.clear()
        self.do("Page.navigate", url=path.as_uri())
        while not any(event == "Page.loadEventFired" for event, _ in self.told):
            self._next()

    def ask(self, expression):
        answer = self.do("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression, seconds=30.0):
        end = time.monotonic() + seconds
        while not (found := self.ask(f"(() => {{ try {{ return {expression} }} catch (e) {{ return null }} }})()")):
            assert time.monotonic() < end, expression
            time.sleep(0.1)
        return found

    def printed(self):
        return base64.b64decode(self.do("Page.printToPDF", preferCSSPageSize=True)["data"])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page about three stations, two angles and two forces, with a failed case and one not solved."""
    folder = tmp_path_factory.mktemp("page")
    path = view_files.make(folder / "thing.hdf")
    with h5py.File(path, "r+") as file:
        file["study/status/message"][view_files.FAILED] = REASON.encode()
        file["study/status/code"][0, 0, 0] = 0
    sealed(path)
    assert main(["report", str(path), "-o", str(folder / "thing.html"), "--candidate", "4"]) == 0
    return folder / "thing.html"


@pytest.fixture
def browser(tmp_path):
    with closing(Browser(tmp_path / "profile")) as opened:
        yield opened


def test_the_page_opens_without_a_complaint_runs_no_script_from_elsewhere_and_answers_choices(browser, page, tmp_path):
    said = "document.querySelector('.controls p').textContent"
    browser.open(page)
    assert browser.wait(said)
    browser.ask("plots.forEach(drawn)")
    browser.wait("plots.every((div) => div.querySelector('.main-svg'))")
    assert not {"Runtime.consoleAPICalled", "Runtime.exceptionThrown"} & {event for event, _ in browser.told}
    asked = " ".join(values for event, values in browser.told if event == "Network.requestWillBeSent")
    assert not re.search(r'"request": {"url": "(?!data:|file:)', asked)
    assert page.stat().st_size < 8e6
    changed = tmp_path / "changed.html"
    changed.write_text(page.read_text().replace("</main>", "<script>document.title = 'ran'</script></main>"))
    browser.open(changed)
    assert browser.ask("document.title") != "ran"
    assert any("Content Security Policy" in text for _, text in browser.told)
    browser.open(page)
    browser.wait(said)
    assert browser.ask("document.querySelector('#maps').textContent").count(REASON) == 1  # why cases failed
    assert REASON in browser.ask("document.querySelector('#cases table').textContent")
    assert browser.ask("document.querySelector('h1').textContent").startswith("<b>thing</b>")
    assert browser.ask("document.querySelectorAll('b').length") == 0
    shown = "document.querySelector('.plot').data[0].intensity.reduce((m, v) => Math.max(m, v), 0)"
    assert browser.ask(shown) == 2.0  # quality of the best grasp at 5 N
    browser.ask("document.querySelector('select').value = 'e_n'")
    browser.ask("document.querySelector('select').dispatchEvent(new Event('change'))")
    assert browser.ask(shown) == 10.0
    browser.ask("document.querySelector('input').value = 0")
    browser.ask("document.querySelector('input').dispatchEvent(new Event('input'))")
    assert "1 N" in browser.ask(said)


def test_a_phone_does_not_scroll_sideways_and_it_prints_all_numbers_without_its_scripts(browser, page, tmp_path):
    browser.open(page, 380, 720, phone=True)
    assert browser.ask("[document.documentElement.scrollWidth, innerWidth]") == [380, 380]
    plain = tmp_path / "plain.html"
    plain.write_text(re.sub(r"<script>.*?</script>", "", page.read_text(), flags=re.DOTALL))
    browser.open(plain)
    assert browser.ask("document.querySelectorAll('#cases tbody tr').length") == 12
    assert browser.ask("[...document.querySelectorAll('.plot')].every((p) => p.ariaLabel.length > 20)")
    browser.open(page)
    assert browser.printed().startswith(b"%PDF")
