"""The report in a browser: opens without a complaint, draws, keeps scripts from elsewhere out, fits a phone, prints."""

import re
from contextlib import closing

import h5py
import pytest

from softjaw.study.cli import main
from tests.study import view_files
from tests.study.chromium import PROGRAM, Browser
from tests.study.sealing import sealed

pytestmark = [pytest.mark.long, pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine")]
REASON = "</script> convergence <b>lost</b>"


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
