"""What a run shows: the table at its end, and the page."""

import hashlib
from html.parser import HTMLParser

from workflow_tools import BENT, ROOT


def test_a_run_ends_with_a_table(finished):
    text = (finished.folder / "log.txt").read_text()
    lines = text[text.index("\nfabric  ") + 1 :].splitlines()
    assert "strain at 50" in lines[0]
    assert any(line.startswith("small") for line in lines)
    assert any(line.startswith(BENT[0]) for line in lines)
    assert "page: results/index.html" in lines


class Links(HTMLParser):
    """What a page links to, what can be linked to in it, and what it loads."""

    def __init__(self, text):
        super().__init__()
        self.links, self.names, self.loaded = [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.names.add(given.get("id"))
        if tag == "a":
            self.links.append(given["href"])
        self.loaded += [given[name] for name in ("src", "srcset") if name in given]
        assert tag not in ("link", "script", "iframe")


def test_the_page_is_whole_by_itself_and_its_links_lead_somewhere(finished):
    page = Links((finished.results / "index.html").read_text(encoding="utf-8"))
    assert len(page.links) > 50 and len(page.loaded) > 10
    assert all(source.startswith("data:image/webp;base64,") for source in page.loaded)
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.names, link
        else:
            assert (finished.results / link).is_file(), link
    # What is behind each picture is one click away.
    for kind in ("png", "svg", "nc", "csv"):
        assert any(link.endswith(f".{kind}") for link in page.links)


def test_the_page_tells_the_hash_of_each_file(finished):
    text = (finished.results / "index.html").read_text(encoding="utf-8")
    files = [*finished.results.glob("*/**/*.nc"), finished.results / "tables/kes.csv"]
    assert len(files) > 10
    for path in files:
        assert hashlib.sha256(path.read_bytes()).hexdigest()[:16] in text, path


def test_every_rule_says_what_it_needs_and_none_counts_the_cores():
    for path in (ROOT / "workflow/rules").glob("*.smk"):
        text = path.read_text()
        assert "workflow.cores" not in text
        assert text.count("script:") == text.count("mem_mb=") == text.count("runtime="), path
