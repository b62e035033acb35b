"""The report in a browser: it opens without a complaint, tells the cells of its maps, fits a phone, and prints."""

from __future__ import annotations

import io
import json
import os
import re
import signal

import h5py
import numpy as np
import pytest

from softjaw.study.cli import main
from softjaw.study.messages import RANK
from softjaw.study.result.store import open_result
from softjaw.study.show.data import Data
from softjaw.study.show.report import object_view
from softjaw.study.show.view.model import View
from tests.study import view_files
from tests.study.chromium import PROGRAM, Browser
from tests.study.formula_results import make
from tests.study.sealing import sealed

pytestmark = [
    pytest.mark.long,
    pytest.mark.launches,
    pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine"),
]
REASON = "</script> convergence <b>lost</b>"
TOLD = "document.getElementById('told')"


@pytest.fixture(scope="module")
def page(tmp_path_factory, comm):
    """A page about three stations, two angles and two forces, with a failed case and one not solved."""
    folder = comm.bcast(tmp_path_factory.mktemp("page") if comm.rank == 0 else None)
    if comm.rank == 0:
        path = view_files.make(folder / "thing.hdf")
        with h5py.File(path, "r+") as file:
            file["study/status/message"][view_files.FAILED] = REASON.encode()
            file["study/status/code"][0, 0, 0] = 0
        sealed(path)
        with pytest.MonkeyPatch.context() as patched:
            for name in RANK:
                patched.delenv(name, raising=False)
            assert main(["report", str(path), "-o", str(folder / "thing.html"), "--candidate", "4"]) == 0
    comm.Barrier()
    return folder / "thing.html"


@pytest.fixture
def browser(tmp_path):
    with Browser(tmp_path / "profile") as opened:
        yield opened


def middle(browser, selector, column, row, columns, rows):
    """Middle of a map's cell in the window, after scrolling there."""
    browser.ask(f"document.querySelector('{selector}').scrollIntoView({{block: 'center'}})")
    found = json.loads(browser.ask(f"JSON.stringify(document.querySelector('{selector}').getBoundingClientRect())"))
    return found["x"] + found["width"] * (column + 0.5) / columns, found["y"] + found["height"] * (row + 0.5) / rows


def test_the_page_opens_without_a_complaint_and_asks_for_nothing(browser, page):
    browser.open(page)
    assert browser.told == []
    assert browser.ask("[...document.images].every((i) => i.complete && i.naturalWidth > 0)")
    assert browser.ask("document.querySelectorAll('.spot').length") >= 4
    assert page.stat().st_size < 4e6


def test_a_script_from_elsewhere_is_not_run(browser, page, tmp_path):
    changed = tmp_path / "changed.html"
    changed.write_text(page.read_text().replace("</main>", "<script>document.title = 'ran'</script></main>"))
    browser.open(changed)
    assert browser.ask("document.title") != "ran"
    assert any("Content Security Policy" in text for _, text in browser.told)


def test_pointing_at_a_cell_tells_its_values(browser, page):
    """The upper row is 5 N; station 0 mm at the first angle has quality 2 there."""
    browser.open(page)
    x, y = middle(browser, "#maps .spot", 1, 0, 3, 2)
    assert browser.ask(f"{TOLD}.hidden")
    browser.point(x, y)
    told = browser.ask(f"{TOLD}.innerText").replace("\u00a0", " ")
    assert told.startswith("station 0 mm, angle 0°, 5 N")
    assert re.search(r"quality\s+2\b", told)
    assert re.search(r"e_n \[mm\]\s+10\b", told)
    marked = browser.ask("[...document.querySelectorAll('#maps .cell')].filter((c) => !c.hidden).length")
    assert marked >= 2  # the same case in the map beside it
    box = browser.ask("(() => { const c = document.querySelector('#maps .cell').getBoundingClientRect(); "
                      "return [c.left, c.right, c.top, c.bottom] })()")  # fmt: skip
    assert box[0] < x < box[1]
    assert box[2] < y < box[3]
    browser.point(2, 2)
    assert browser.ask(f"{TOLD}.hidden")
    assert browser.told == []


def test_failed_and_missing_cells_say_so_as_text(browser, page):
    browser.open(page)
    number = np.ravel_multi_index(view_files.FAILED, (3, 2, 2))
    spots = browser.ask("JSON.stringify([...document.querySelectorAll('[data-spots]')].map((f) => f.dataset.spots))")
    assert any(int(number) in row for text in json.loads(spots) for s in json.loads(text) for row in s["cases"])
    x, y = middle(browser, "#maps .spot", 0, 1, 3, 2)
    browser.point(x, y)
    assert "missing" in browser.ask(f"{TOLD}.innerText")
    row = browser.ask(f"document.getElementById('case-{number}').textContent")
    assert "failed" in row
    assert REASON in row
    assert browser.ask("document.querySelector('#maps table').textContent").count(REASON) == 1  # why cases failed
    assert browser.ask("document.querySelectorAll('b').length") == 0


def test_the_keyboard_goes_from_cell_to_cell(browser, page):
    browser.open(page)
    browser.ask("document.querySelector('#maps .spot').focus()")
    begun = browser.ask(f"{TOLD}.innerText").replace("\u00a0", " ")
    assert begun.startswith("station 0 mm, angle 0°, 5 N")  # the best grasp
    browser.press("ArrowRight")
    browser.press("ArrowDown")
    browser.press("ArrowDown")  # there is no row below
    assert browser.ask(f"{TOLD}.innerText").replace("\u00a0", " ").startswith("station 20 mm, angle 0°, 1 N")
    browser.press("Escape")
    assert browser.ask(f"{TOLD}.hidden")


def test_it_speaks_to_screen_readers(browser, page):
    browser.open(page)
    nodes = browser.do("Accessibility.getFullAXTree")["nodes"]
    roles = {node["role"]["value"] for node in nodes if "role" in node}
    assert roles >= {"main", "banner", "navigation", "table", "columnheader", "rowheader", "region", "application"}
    assert browser.ask(f"{TOLD}.tagName") == "OUTPUT"
    assert browser.ask("[...document.images].every((i) => i.alt.length > 20)")
    names = browser.ask("[...document.querySelectorAll('.spot')].map((s) => s.getAttribute('aria-label'))")
    assert all("arrow keys" in name for name in names)
    assert browser.ask("[...document.querySelectorAll('section')].every((s) => s.ariaLabel || "
                       "document.getElementById(s.getAttribute('aria-labelledby')))")  # fmt: skip


def test_on_a_phone_the_page_does_not_scroll_sideways_and_a_tap_tells(browser, page):
    browser.open(page, 380, 720, phone=True)
    assert browser.ask("[document.documentElement.scrollWidth, innerWidth]") == [380, 380]
    browser.tap(*middle(browser, "#maps .spot", 1, 0, 3, 2))
    told = json.loads(browser.ask(f"JSON.stringify({TOLD}.getBoundingClientRect())"))
    assert "quality" in browser.ask(f"{TOLD}.innerText")
    assert told["left"] >= 0
    assert told["right"] <= 380
    assert told["bottom"] <= 720


def test_the_force_of_maps_over_many_angles_can_be_chosen(browser, tmp_path):
    path = make(tmp_path / "f.hdf", lambda station, angle, force: 0.01 + station + 0.01 * angle + 1e-3 * force)
    assert main(["report", str(path), "-o", str(tmp_path / "f.html")]) == 0
    browser.open(tmp_path / "f.html")
    assert browser.told == []
    seen = "[...document.querySelectorAll('.choice figure')].map((f) => f.offsetHeight > 0)"
    assert browser.ask(seen) == [False, False, False, True]
    browser.ask("document.querySelectorAll('.choice input')[1].click()")
    assert browser.ask(seen) == [False, True, False, False]
    caption = browser.ask("document.querySelectorAll('.choice figcaption')[1].textContent")
    assert "normal force 2 N" in caption
    browser.point(*middle(browser, ".choice figure:nth-of-type(2) .spot", 1, 5, 5, 6))
    assert browser.ask(f"{TOLD}.innerText").replace("\u00a0", " ").startswith("station 10 mm, angle 0°, 2 N")
    browser.do("Emulation.setEmulatedMedia", media="print")
    assert browser.ask(seen) == [True, True, True, True]


def test_it_prints_and_says_everything_without_its_script(browser, page, tmp_path):
    plain = tmp_path / "plain.html"
    plain.write_text(re.sub(r"<script>.*</script>", "", page.read_text(), flags=re.DOTALL))
    browser.open(plain)
    assert browser.ask("[...document.getElementById('case-3').cells].map((c) => c.textContent)")[1] == "solved"
    assert browser.ask("document.images.length") >= 6
    browser.open(page)
    assert browser.printed().startswith(b"%PDF")
    browser.do("Emulation.setEmulatedMedia", media="print")
    assert browser.ask("getComputedStyle(document.querySelector('.spot')).display") == "none"


def test_maps_still_differ_in_grey(browser, page):
    """The map on screen, without its colours, spans more than a third of all greys."""
    from PIL import Image

    browser.open(page)
    x, y = middle(browser, "#maps .spot", 0, 0, 3, 2)
    picture = np.asarray(Image.open(io.BytesIO(browser.picture(whole=False))).convert("L")).astype(int)
    box = json.loads(browser.ask("JSON.stringify(document.querySelector('#maps .spot').getBoundingClientRect())"))
    found = picture[int(box["top"]) : int(box["bottom"]), int(box["left"]) : int(box["right"])]
    assert np.ptp(np.percentile(found, [2, 98])) > 255 / 3
    assert picture[int(y), int(x)] != 255


def test_the_object_is_seen_from_two_sides_and_its_absence_is_told(page, monkeypatch):
    with open_result(page.with_suffix(".hdf")) as result:
        data = Data(result)
        limits = {"quality": (0.0, 2.0)}
        sides = object_view.in_a_child(View(data, ()), data.best, limits)
        if sides is None:
            pytest.skip("this machine draws nothing without a screen")
        assert sides.shape[:2] == (1, 2)
        colours = {tuple(c) for c in sides[0, 0].reshape(-1, 3)[::7]}
        assert len(colours) > 50

        def crash(*_):
            os.kill(os.getpid(), signal.SIGKILL)

        monkeypatch.setattr(object_view, "_draw", crash)  # VTK ends the process without EGL and OSMesa
        assert object_view.in_a_child(View(data, ()), data.best, limits) is None
        assert object_view.NO_RENDERER.split(",")[0] in object_view.object_section(data, data.best)
