"""The built site is whole, loads nothing from elsewhere, and its search finds pages; `make site` builds it first."""

from __future__ import annotations

import html.parser
import subprocess
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from ldcs_ros.viewing.browser import find_browser

SITE = Path(__file__).resolve().parents[2] / "out/site"
TOPICS = ("torque", "Modbus", "accuracy", "sensitivity")

pytestmark = pytest.mark.skipif(not (SITE / "index.html").exists(), reason="`make site` builds the site")


class _Page(html.parser.HTMLParser):
    """The links of a page, what it loads, and the anchors that it offers."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if "id" in given:
            self.anchors.add(given["id"])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in ("script", "img", "iframe") and "src" in given:
            self.loads.append(given["src"])
        if tag == "link" and given.get("rel") in ("stylesheet", "icon"):
            self.loads.append(given.get("href", ""))


@pytest.fixture(scope="module")
def pages() -> dict[Path, _Page]:
    return {path: _Page(path) for path in SITE.rglob("*.html")}


def test_every_link_inside_of_the_site_leads_to_a_file_and_an_anchor(pages):
    broken = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                broken.append(f"{path.name}: {link}")
            elif target in pages and parts.fragment and unquote(parts.fragment) not in pages[target].anchors:
                broken.append(f"{path.name}: {link}, no such anchor")
    assert len(pages) > 20
    assert not broken, broken[:10]


def test_the_site_loads_nothing_from_another_host(pages):
    foreign = {
        f"{path.name}: {load}" for path, page in pages.items() for load in page.loads if urlsplit(load).netloc
    }
    assert not foreign


@pytest.mark.skipif(find_browser() is None, reason="no chromium here to search the site")
@pytest.mark.parametrize("topic", TOPICS)
def test_the_search_finds_a_page_on(topic, tmp_path):
    browser = find_browser()
    assert browser is not None
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
    ]
    options += [f"--user-data-dir={tmp_path}", "--virtual-time-budget=10000", "--dump-dom"]
    url = f"{(SITE / 'search.html').as_uri()}?q={topic}"
    done = subprocess.run([browser, *options, url], capture_output=True, text=True, timeout=60, check=True)
    results = done.stdout.partition('id="search-results"')[2]
    assert "Search finished" in results
    assert results.count("<li") >= 2, results[:400]
