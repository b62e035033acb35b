"""The site of docs/: generated pages hold everything that they are made from, and every link leads somewhere."""

import re
import subprocess
import tomllib
from functools import cache
from pathlib import Path

import pytest

from docs.generate import PAGES
from softjaw.study.cli.options import COMMANDS
from softjaw.study.flags import Flag
from softjaw.study.quantities import EFFECTS, TABLE
from softjaw.study.scene import Scene

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]*)?\)")


@cache
def page(name: str) -> str:
    return PAGES[f"reference/{name}.md"]()


def cells(name: str) -> set[str]:
    return {found.strip("`") for found in re.findall(r"^\| (.+?) \|", page(name), re.M)}


def test_every_key_quantity_flag_and_effect_has_a_row_and_every_command_is_shown():
    schema = Scene.model_json_schema()
    models = [*schema["$defs"].values(), schema]
    keys = {key for model in models for key in model.get("properties", {})} - set(schema["properties"]) - {"shape"}
    assert len(keys) > 60
    assert not keys - cells("scene")
    for section in schema["properties"]:
        assert f"## `[{section}]`" in page("scene")
    assert not {q.name for q in TABLE} - cells("quantities")
    assert not {str(int(flag)) for flag in Flag} - cells("flags")
    assert not set(EFFECTS) - cells("flags")
    for name in (name for group in COMMANDS.values() for name, *_ in group):
        assert f"### softjaw {name}\n" in page("commands")
        assert f"usage: softjaw {name} " in page("commands")


def anchors(text: str) -> set[str]:
    heads = re.findall(r"^#+ (.+)$", text, re.M)
    return {"#" + re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", head.lower()).strip()) for head in heads}


@pytest.mark.parametrize("file", [*sorted(DOCS.glob("*.md")), *sorted(ROOT.glob("C*.md"))], ids=lambda file: file.stem)
def test_links_lead_somewhere(file):
    wrong = []
    for target, anchor in LINK.findall(file.read_text()):
        if "://" in target:
            continue
        found = (file.parent / target).resolve() if target else file
        generated = PAGES.get(target)
        if not generated and not found.is_file():
            wrong.append(target)
        elif anchor and anchor not in anchors(generated() if generated else found.read_text()):
            wrong.append(target + anchor)
    assert not wrong


def test_the_navigation_names_every_page_and_none_that_is_not_there_and_the_tutorial_its_scene():
    listed = re.findall(r"^ +- (\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.M)
    assert len(listed) == len(set(listed)) > 30
    assert set(PAGES) < set(listed) <= {file.name for file in DOCS.glob("*.md")} | set(PAGES)
    (shown,) = re.findall(r"^```toml\n(.*?)^```$", (DOCS / "tutorial.md").read_text(), re.M | re.S)
    assert tomllib.loads(shown) == tomllib.loads((ROOT / "jobs" / "flask-mesh.toml").read_text())


@pytest.mark.long
def test_the_site_is_built_and_needs_no_network():
    done = subprocess.run(["make", "docs"], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    if "could not find a version" in done.stderr.lower():
        pytest.skip("mkdocs-material is not here and cannot be had")
    assert done.returncode == 0, done.stdout + done.stderr
    pages = list((ROOT / "build" / "site").rglob("*.html"))
    assert len(pages) > len(PAGES) + 20
    loaded = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*?(?:src|href)=["']?(?:https?:)?//(?!squidfunk)""")
    assert not [page.name for page in pages if loaded.search(page.read_text())]
