"""The report: the numbers it gives for synthetic studies, that it needs nothing from outside, and odd files."""

import base64
import hashlib
import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from softjaw.study.case.result import CaseResult
from softjaw.study.flags import Flag
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, StudyError
from softjaw.study.page import box, bullets, page, table, text
from softjaw.study.quantities import Axis
from softjaw.study.ranking import judge
from softjaw.study.result.layout import Layout
from softjaw.study.result.read import open
from softjaw.study.show import best_grasps
from softjaw.study.show.best_grasps import best
from softjaw.study.show.grasps import at, order
from softjaw.study.show.report import curves, tables, verdict
from softjaw.study.show.report.writing import build, write_report
from tests.study.formula_results import OBJECT, grid_axes, written
from tests.study.launching import refusal

FACES = (6, 4)
SCENE = f"{OBJECT}[candidates]\nstations_mm = [0, 10, 20, 30]\n[load]\nnormal_force_n = [1, 5]\n"
SWEEP = SCENE + '[sweep]\n"object.semi_axis_b_mm" = [10, 25, 50]\n'
VOID = {"meta", "img", "br", "link", "input", "hr"}


def axes(stations=(0, 0.01, 0.02, 0.03), angles=(0, 0.5, 1.0), forces=(1.0, 5.0), **more):
    return grid_axes(stations, angles, forces, **more)


def patch():
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-0.01, 0.01, n) for n in FACES), indexing="ij"))
    centroid = np.stack([x, y, 0.1 * y**2], axis=-1)
    pressure = np.maximum(0.0, 1e4 * (1 - (y / 0.009) ** 2))
    normal = np.broadcast_to([0.0, 0.0, 1.0], centroid.shape)
    one = {"pressure": pressure, "area": np.full(len(x), 2e-5), "centroid": centroid, "normal": normal}
    return {name: np.stack([values, values]) for name, values in one.items()}


def solved(layout, index, message="", **changes):
    """A case whose quality is largest at station 2 and angle 1, and grows with the force."""
    force = layout.axes[-1].values[index[-1]]
    peak = 1.0 / (1 + abs(index[-3] - 2) + 2 * abs(index[-2] - 1))
    by_model = peak * np.array([1.0, 1.1, 0.9])
    values = {f"maps/{name}": by_model * factor for name, factor in (("quality", force), ("e_n", 0.01))}
    values |= {f"maps/{name}": by_model * 0.8 * force for name in ("f_x_max", "f_y_max")}
    values |= {"maps/tau_z_max": by_model * 1e-2 * force, "maps/contact_distance": 0.04, "maps/opening": 0.04}
    values |= {"maps/flags": 0.0}
    values |= {"checks/force_balance": [1e-12, 2e-12], "checks/min_det_f": [0.5, 0.6], "work/seconds_total": 1.5}
    values |= {"work/seconds_assembly": 1.0, "fingers/frame_origin": np.zeros((2, 3))}
    values |= {"fingers/frame_axes": np.stack([np.eye(3)] * 2)} | changes
    values = {key: value for key, value in values.items() if value is not None}
    faces = patch() if layout.faces else None
    return CaseResult(values, faces, message, {"sheet": ("elastic plate", 0.2, 0)})


def make(path, layout, state=lambda index: "done", scene=SCENE, title="thing", message="", labels=(), **changes):
    def case(index):
        what = state(index)
        return {"done": solved(layout, index, message, **changes), "missing": None}.get(what, what)

    return written(path, layout, case, scene=scene, title=title, labels=labels)


class Page(HTMLParser):
    def __init__(self, html):
        super().__init__()
        self.open, self.found, self.text, self.balanced = [], [], "", True
        self.feed(html)
        self.balanced &= not self.open

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        self.balanced &= bool(self.open) and self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "script"} & set(self.open):
            self.text += data

    def tags(self, name):
        return [attributes for tag, attributes in self.found if tag == name]


def figures(html):
    return [json.loads(text) for text in re.findall(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)]


@pytest.fixture(scope="module")
def ordinary(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")

    def state(index):
        if index == (0, 0, 0):
            return "missing"
        return f"ConvergenceError: residual {index[1]}.5e-03 at station <b>{index[0]}" if index[0] == 3 else "done"

    texts = {"title": "<script>alert('x')</script> & co", "message": "a <i>note</i>"}
    path = make(folder / "study.hdf", Layout(axes(), 24), state, **texts)
    written = write_report(path, folder / "study.html")
    return path, written, Page(written.read_text())


def test_the_page_is_well_formed_needs_nothing_from_outside_and_runs_its_own_scripts_alone(ordinary):
    _, written, page = ordinary
    html = written.read_text()
    scripts = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
    assert len(scripts) == 2  # plotly and the page's own
    assert len(page.tags("script")) == 2 + len(figures(html))
    (policy,) = (m["content"] for m in page.tags("meta") if "http-equiv" in m)
    for script in scripts:
        assert f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" in policy
    assert "default-src 'none'" in policy
    assert not re.search(r"innerHTML|insertAdjacent|document.write|eval|fetch|XMLHttp", scripts[1])
    assert not any(page.tags(name) for name in ("link", "iframe", "img"))
    assert all(link["href"].startswith("#") for link in page.tags("a"))
    assert not any(key.startswith("on") or key == "src" for _, attributes in page.found for key in attributes)
    assert not re.search(r"https?://", html.replace(scripts[0], ""))
    assert page.balanced
    assert page.tags("html")[0]["lang"] == "en"
    assert len(page.tags("h1")) == 1
    assert len(page.tags("main")) == 1
    levels = [int(tag[1]) for tag, _ in page.found if re.fullmatch("h[1-6]", tag)]
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    assert all(len(d["aria-label"]) > 20 for d in page.tags("div") if d.get("class") == "plot")
    assert len(page.tags("caption")) == len(page.tags("table")) > 5
    anchors = {section["id"] for section in page.tags("section")}
    assert {link["href"][1:] for link in page.tags("a")} <= anchors


def test_texts_of_the_file_are_escaped_in_the_page_and_in_its_figures(ordinary):
    _, written, page = ordinary
    html = written.read_text()
    assert "<script>alert('x')</script> & co" in page.text
    assert "a <i>note</i>" in page.text
    own = re.sub(r"<script>.*?</script>", "", html, flags=re.DOTALL)  # what plotly is made of is not from the file
    for evil in ("<script>alert", "<b>", "<i>note", "</script> &"):
        assert evil not in own
    for data in re.findall(r'<script type="application/json">(.*?)</script>', own, re.DOTALL):
        assert not set(data) & set("<>&'")
    notes = json.dumps(figures(html))
    assert "&lt;b&gt;3" in notes  # the reason of a failure: plotly reads tags in what it draws
    assert "<b>3" not in re.sub(r'"words": {[^}]*}', "", notes)  # the script sets these as text


def test_the_verdict_and_tables_have_the_numbers_of_the_best_grasps_and_of_the_states(ordinary):
    path, _, page = ordinary
    data = judge(open(path))
    first = best(data).rows[0]
    assert data.attrs["best"] == (2, 1, 1)
    assert (first["station"], first["angle"]) == (data.station.values[2], data.angle.values[1])
    sentences, lines = verdict.verdict(data), best_grasps.answer(data, data.attrs["best"])
    found = [lines[name][0] for name in ("where", "opening", "force")]
    assert found == ["station 20 mm, angle 28.65 deg", "40 mm", "5 N per finger"]
    assert any("10 % more quality" in sentence for sentence in sentences)
    assert [int(n) for n in re.findall(r"\d+", sentences[-1])] == [17, 24, 6, 1]
    assert all(sentence in page.text for sentence in sentences)
    ranked, by_force = (block for block in tables.best_grasps(data) if block["kind"] == "table")
    assert ranked["first"]
    column = [row[ranked["head"].index("f_x_max [N]")] for row in ranked["rows"]]
    assert column[:2] == ["4", "2"]  # 0.8 * 5 N at the peak, half of it beside it
    assert [row[by_force["head"].index("force [N]")] for row in by_force["rows"]] == ["1", "5"]
    assert [row[by_force["head"].index("quality")] for row in by_force["rows"]] == ["1", "5"]


def test_maps_show_every_case_in_both_models_with_crosses_for_failed_ones(ordinary):
    """Quality is force / (1 + |i - 2| + 2 |j - 1|), the flat model's 1.1 times that; angles 0 and 2 are images."""
    _, written, _ = ordinary
    maps = [f for f in figures(written.read_text()) if any(t["type"] == "heatmap" and "updatemenus" in f["layout"]
                                                             for t in f["data"])]  # fmt: skip
    over_force = maps[0]["data"]
    heat = [t for t in over_force if t["type"] == "heatmap"]
    assert [[len(t["z"]), len(t["z"][0])] for t in heat if t["z"]] == [[2, 4]] * len(heat)
    for column, model in enumerate((1.0, 1.1)):
        assert heat[column]["z"][1][:3] == pytest.approx([model * 5 / (3 + abs(i - 2)) for i in range(3)])
        assert heat[column]["z"][0][0] is None  # missing
        assert heat[column]["z"][1][3] is None  # failed
    assert "failed: ConvergenceError" in heat[0]["customdata"][1][3]
    marked = [t for t in over_force if t["type"] == "scatter" and t["marker"]["symbol"] == "x-thin-open"]
    assert len(marked) == len(heat)
    assert len(marked[0]["x"]) == 2
    names = [b["label"] for b in maps[0]["layout"]["updatemenus"][0]["buttons"]]
    assert len(names) == len(set(names)) >= 5


def test_values_have_their_error_and_a_chosen_candidate_stands_beside_the_best_one(tmp_path):
    layout = Layout(axes(), 0, has=("two meshes",))
    path = make(tmp_path / "two.hdf", layout, **{"maps/e_n_error": 0.0042, "maps/tau_z_max_error": 0.011})
    (folded,) = tables.every_case(judge(open(path)))
    block = folded["blocks"][0]
    assert len(block["rows"]) == 24
    assert all("\N{NO-BREAK SPACE}±" in row[block["head"].index("e_n [mm]")] for row in block["rows"])
    assert not any("±" in row[block["head"].index("quality")] for row in block["rows"])
    # Case (3, 0, 1) has quality 5 / 4.
    def state(index):
        return "it slipped away" if index[:2] == (3, 2) else "done"

    ds = open(make(tmp_path / "f.hdf", Layout(axes(), 24), state))
    tables_of = [tables.best_grasps(judge(ds, index)) for index in (None, (3, 0, 1), (3, 2, 1))]
    plain, chosen, failed = ([b for b in blocks if b["kind"] == "table"] for blocks in tables_of)
    assert (len(plain), len(chosen), len(failed)) == (2, 3, 3)
    (row,) = chosen[2]["rows"]
    cells = dict(zip(chosen[2]["head"], row, strict=True))
    assert [cells[k] for k in ("name", "station [mm]", "force [N]", "quality")] == ["s09", "30", "5", "1.25"]
    assert "it slipped away" in failed[2]["rows"][0]
    with pytest.raises(StudyError, match="--candidate"):
        build(ds, 12)


SMALL = axes(stations=(0.01,), angles=(0.0,), forces=(3.0,))
POSES = axes(stations=(0, 1), angles=(0.0,), forces=(1.0, 2.0), poses=True)
TEXTS = (Axis("material", np.array([0.0, 1.0]), "", "gripper.material", ("blatz_ko", "neo_hookean")),)


@pytest.mark.parametrize(("layout", "options", "expected"), [
    (Layout(SMALL, 0), {}, "station 10 mm"),
    (Layout(SMALL, 24), {"state": lambda i: "it failed"}, "0 of 1"),
    (Layout(SMALL, 24), {"state": lambda i: "missing", "scene": "a = 1"}, "0 of 1"),
    (Layout(SMALL, 0), {"maps/quality": None, "maps/e_n": None}, "station 10 mm"),
    (Layout(POSES, 0), {"labels": ("left <&>", "right")}, "right"),
    (Layout(axes((0,), (0,), (1.0,), sweep=TEXTS), 0), {"scene": "a = 1"}, "blatz_ko"),
], ids=["one case", "all failed", "nothing done", "no scores", "poses", "sweep of texts"])  # fmt: skip
def test_odd_files_give_a_page(tmp_path, layout, options, expected):
    page = Page(build(open(make(tmp_path / "odd.hdf", layout, **options))))
    assert page.balanced
    assert expected in page.text


@pytest.mark.parametrize(("layout", "values", "expected"), [
    (Layout(SMALL, 24), {"checks/min_det_f": [0.1, -0.1]}, "min det f -0.1"),
    (Layout(SMALL, 0), {"maps/payload": [0.25] * 3}, "250 g"),
], ids=["bad check", "payload"])  # fmt: skip
def test_the_verdict_warns_of_what_the_best_case_lacks(tmp_path, layout, values, expected):
    data = judge(open(make(tmp_path / "one.hdf", replace(layout, faces=0), **values)))
    lines = [" ".join(line) for line in best_grasps.answer(data, data.attrs["best"]).values()]
    assert expected in " ".join([*lines, *verdict.verdict(data), *verdict.warnings(data)])


def test_the_verdict_says_why_a_higher_score_is_not_the_best_grasp_and_the_same_file_gives_the_same_page(tmp_path):
    ds = open(make(tmp_path / "two.hdf", Layout(axes((0, 0.02), (0.0,), (1.0,)), 0)))
    data = judge(ds)
    worse, better = sorted(order(data, 0), key=lambda i: at(data, "quality", i))
    assert Flag.TOO_STRONG.word not in best_grasps.answer(data, data.attrs["best"])["limit"][1]
    ds["flags"].values[better] = Flag.TOO_STRONG
    data = judge(ds)
    assert data.attrs["best"] == worse
    assert Flag.TOO_STRONG.word in best_grasps.answer(data, worse)["limit"][1]
    path = make(tmp_path / "small.hdf", Layout(SMALL, 24))
    one, two = (write_report(path, tmp_path / name) for name in ("one.html", "two.html"))
    assert one.read_bytes() == two.read_bytes()
    with refusal(CANNOT_WRITE, match="html"):
        write_report(path, path)
    with refusal(OTHER_FILE):
        write_report(tmp_path / "none.hdf", tmp_path / "r.html")
    assert {p.name for p in tmp_path.iterdir()} == {"two.hdf", "small.hdf", "one.html", "two.html"}


def test_differences_are_drawn_over_the_ratio_of_the_axes_and_a_page_escapes_every_kind_of_block(tmp_path):
    """Pressed along a = 25 mm: a / b = 2.5, 1, 0.5 and a / b^2 = 250, 40, 10 per metre."""
    sweep = (Axis("semi_axis_b", np.array([0.01, 0.025, 0.05]), "m", "object.semi_axis_b_mm"),)
    layout = Layout(axes((0.0,), (0.0,), (1.0, 5.0), sweep=sweep), 0)
    path = make(tmp_path / "sweep.hdf", layout, scene=SWEEP, **{"maps/f_y_overestimate": 0.04})
    data = judge(open(path)).assign(b_over_a=("semi_axis_b", [0.4, 1.0, 2.0]))
    data = data.assign(apex_curvature=("semi_axis_b", [250.0, 40.0, 10.0]))
    found = [block["figure"].data for block in curves.differences(data, data.attrs["best"])]
    (ratio,), (curvature,) = found
    assert ratio.x == pytest.approx([0.5, 1, 2.5])
    assert curvature.x == pytest.approx([10, 40, 250])
    assert ratio.y == pytest.approx([4, 4, 4])
    # Also where a reader's attributes are made of it.
    evil = "</script><script>x</script>'\"&<b>"
    blocks = [text(evil), text("a", evil), {"kind": "heading", "text": evil}, box([evil], evil),
              {"kind": "answer", "lines": [(evil, evil, evil)]}, {"kind": "pre", "text": evil}, bullets([evil]),
              table(evil, [evil], [[evil]], texts=(0,)),
              {"kind": "details", "summary": evil, "blocks": [text(evil)]}]  # fmt: skip
    made = page(evil, evil, [(evil, evil, blocks), ("other", evil, [])])
    assert "<script" not in made
    assert "<b>" not in made
    assert Page(made).balanced
    assert Page(made).text.count(evil) >= 12
