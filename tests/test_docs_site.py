"""The documentation: pictures are made by the commands beside them, commands exist, links lead somewhere."""

import importlib
import itertools
import re
from pathlib import Path
from urllib.parse import urlsplit

import pages
import pictures
import pytest
import typer
from commands import commands, examples, wrapped
from outside_pages import link_on_site
from own_host import loads
from PIL import Image

import ldls
from command import command
from ldls import errors
from ldls.cli import app

ROOT = pages.ROOT
PAGES = [*pages.pages(), ROOT / "BENCHMARKS.md", ROOT / "CHANGELOG.md"]
RECIPES = [(page, recipe) for page in pages.pages() for recipe in pages.recipes(page)]
API = sorted((ROOT / "docs/api").glob("*.md"))
ROOMS = ["ldls.batch", "ldls.datasets", "ldls.evaluation", "ldls.segmenters", "ldls.simulation", "ldls.viewing",
         "ldls.viewing.recording"]  # fmt: skip
LINK = re.compile(r"\]\((?P<link>[^)\s]+)\)")
HEADING = re.compile(r"^#+ (?P<text>.+)$", re.MULTILINE)
HOSTS = {"huggingface.co", "keepachangelog.com", "rerun.io", "rustup.rs", "semver.org", "www.embree.org"}


def name_of(page):
    return page.relative_to(ROOT).as_posix()


def each(page_list):
    return [pytest.param(page, id=name_of(page)) for page in page_list]


# pictures


@pytest.mark.parametrize("page", each(pages.pages()))
def test_every_picture_is_made_by_a_command_beside_it(page):
    made = {picture for recipe in pages.recipes(page) for picture in recipe.files}
    assert set(pages.shown(page)) == made


@pytest.mark.parametrize(
    ("page", "recipe"), [pytest.param(*case, id=f"{name_of(case[0])}: {', '.join(case[1].files)}") for case in RECIPES]
)
def test_the_command_writes_that_file(page, recipe):
    words = [word for command in pages.shell_commands(recipe.commands) for word in itertools.pairwise(command)]
    folders = {Path(value) for option, value in words if option == "--out"}
    written = {value for option, value in words if option == "--picture"}
    for file in recipe.files.values():
        assert file in written or Path(file).parent in folders


def test_every_picture_is_shown():
    shown = {picture for page in pages.pages() for picture in pages.shown(page)}
    assert {name_of(path) for path in pages.PICTURES.rglob("*") if path.is_file()} == shown


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Makes the pictures of a page; those that several pages have in the same way are made once."""
    folders = {}

    def made_of(page):
        done = ""
        for recipe in pages.recipes(page):
            before, done = done, done + recipe.commands
            if done not in folders:
                folders[done] = folders.get(before) or tmp_path_factory.mktemp("pictures")
                pictures.make(recipe, folders[done])
            for picture, file in recipe.files.items():
                yield picture, folders[done] / file

    return made_of


@pytest.mark.parametrize("page", [*each([ROOT / "README.md", ROOT / "docs/index.md", ROOT / "docs/own-sensors.md"])])
def test_pictures_are_made_anew(page, made):
    for picture, file in made(page):
        with Image.open(file) as new, Image.open(ROOT / picture) as kept:
            assert new.size == kept.size


# commands


def in_blocks():
    return [(page, words) for page in PAGES for block in all_blocks(page) for words in pages.commands(block)]


def all_blocks(page):
    text = page.read_text()
    return pages.blocks(text, "sh") + pages.blocks(text, "")


def in_sentences():
    return [(page, words) for page in PAGES for words in pages.inline_commands(page.read_text())]


def in_help():
    texts = [(name, text) for name, command in commands() for text in command.help.split("\n\n") if "ldls " in text]
    return [
        (name, example.split()) for name, text in texts if text.startswith(("Ex", "ldls")) for example in examples(text)
    ]


def cases(found):
    return [pytest.param(words, id=f"{getattr(place, 'name', place)}: {' '.join(words)}") for place, words in found]


def command_of(words):
    """The command that these words name, how it is called, and the words behind it."""
    command, name, rest = typer.main.get_command(app), words[0], words[1:]
    while rest and rest[0] in getattr(command, "commands", {}):
        command, name, rest = command.commands[rest[0]], f"{name} {rest[0]}", rest[1:]
    return command, name, rest


def parsed(words):
    """The command of a line and the values that it gives; fails for an option that there is not."""
    command, name, rest = command_of(words)
    context = command.context_class(command, info_name=name)
    values, left, _ = command.make_parser(context).parse_args(list(rest))
    assert not left, f"{name} takes no {left}"
    return command, values


@pytest.mark.parametrize("words", cases([*in_blocks(), *in_help()]))
def test_a_command_line_is_whole(words):
    command, values = parsed(words)
    assert not hasattr(command, "commands"), "a group of commands alone"
    assert [p.name for p in command.params if p.required and not values.get(p.name)] == []


@pytest.mark.parametrize("words", cases(in_sentences()))
def test_a_command_in_a_sentence_has_these_options(words):
    command, name, rest = command_of(words)
    assert name != "ldls" or rest[0] == "COMMAND" or rest[0].startswith("--"), f"there is no {rest[0]}"
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {word for word in rest if word.startswith("--")} <= known | {"--help"}


def test_an_option_that_there_is_not_is_noticed():
    with pytest.raises(Exception, match="--picure"):
        parsed(["ldls", "info", "mine", "--picure", "a.png"])
    with pytest.raises(AssertionError, match="takes no"):
        parsed(["ldls", "infos", "mine"])


def test_every_command_is_in_the_help():
    names = [name.removeprefix("ldls ") for name, _ in commands()]
    assert {"segment", "run", "masks show"} <= set(names)
    for name in names:
        assert command(*name.split(), "--help").exit_code == 0


# links


def links(page):
    return [found["link"] for found in LINK.finditer(pages.FENCED.sub("", page.read_text()))]


def anchors(page):
    """The anchors of a page's headings, as GitHub and the site make them."""
    headings = [re.sub(r"[^\w\- ]", "", found["text"].lower()) for found in HEADING.finditer(page.read_text())]
    return {heading.replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", each(PAGES))
def test_links_lead_somewhere(page):
    for link in links(page):
        url = urlsplit(link)
        if url.scheme or url.netloc:
            assert url.scheme == "https"
            assert url.netloc in HOSTS
            continue
        target = (page.parent / url.path).resolve() if url.path else page
        assert target.exists(), link
        assert target.is_relative_to(ROOT), link
        # those of functions and classes are made, and checked, by the build
        if url.fragment and target.parent.name != "api":
            assert url.fragment in anchors(target), link


def test_every_page_has_its_place_on_the_site():
    site = (ROOT / "mkdocs.yml").read_text()
    found = [page.relative_to(ROOT / "docs").as_posix() for page in pages.pages()[1:]]
    assert [page for page in found if not re.search(rf"\s{page}$", site, re.MULTILINE)] == []


@pytest.mark.parametrize(
    ("link", "source", "page", "expected"),
    [
        pytest.param("../BENCHMARKS.md", "docs/method.md", "method.md", "benchmarks.md", id="from docs to the root"),
        pytest.param("docs/scale.md", "BENCHMARKS.md", "benchmarks.md", "scale.md", id="from the root to docs"),
        pytest.param("CHANGELOG.md", "BENCHMARKS.md", "benchmarks.md", "changelog.md", id="from root to root"),
        pytest.param("../index.md", "docs/api/io.md", "api/io.md", "../index.md", id="within docs"),
        pytest.param("../../README.md", "docs/api/io.md", "api/io.md", "../index.md", id="the README is the home page"),
        pytest.param("../tests/x.py", "docs/ros.md", "ros.md", "../tests/x.py", id="no part of the site"),
    ],
)
def test_links_between_root_and_docs(link, source, page, expected):
    assert link_on_site(link, source, page) == expected


# what pages must hold


def documented():
    return {name for page in API for name in re.findall(r"^::: (\S+)$", page.read_text(), re.MULTILINE)}


def test_every_public_name_is_in_the_reference():
    public = {name for name in ldls.__all__ if name != "__version__" and not hasattr(errors, name)}
    assert {f"ldls.{name}" for name in public} | {"ldls.errors", *ROOMS} <= documented()


@pytest.mark.parametrize("room", ROOMS)
def test_functions_called_as_their_module_are_in_the_reference(room):
    names = importlib.import_module(room).__all__
    assert names
    # where both have one name, the page of the room sees the module: the function needs an entry of its own
    modules = {path.stem for path in (ROOT / "python" / room.replace(".", "/")).glob("*.py")}
    assert {f"{room}.{name}.{name}" for name in names if name in modules} <= documented()


def test_every_error_and_warning_has_its_row():
    page = (ROOT / "docs/errors.md").read_text()
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type)]
    raised = [kind for kind in kinds if issubclass(kind, errors.LdlsError) and kind is not errors.LdlsError]
    warned = [kind for kind in kinds if issubclass(kind, errors.LdlsWarning) and kind is not errors.LdlsWarning]
    assert [kind for kind in raised if f"| `{kind.code}` | `{kind.__name__}` |" not in page] == []
    assert [kind for kind in warned if f"| `{kind.__name__}` |" not in page] == []
    assert len(raised) > 10


def test_formulas_become_mathml():
    pytest.importorskip("latex2mathml")
    from formulas import on_page_content

    html = on_page_content(r'<p>as <span class="arithmatex">\(a &lt; b_i\)</span></p>', None, None, None)
    assert "<math" in html
    assert "<mi>b</mi>" in html
    assert "arithmatex" not in html
    assert "\\(" not in html


@pytest.mark.parametrize(
    ("html", "count"),
    [
        pytest.param('<script src="https://cdn.example/x.js"></script>', 1, id="script"),
        pytest.param('<link rel="stylesheet" href="//fonts.example/x.css">', 1, id="style without a scheme"),
        pytest.param('<img alt="" src="http://example.org/x.png">', 1, id="picture"),
        pytest.param('<a href="https://rustup.rs">Rust</a>', 0, id="link to follow"),
        pytest.param('<script src="../assets/x.js"></script><link href="site.css">', 0, id="of its own"),
    ],
)
def test_what_a_page_loads_from_another_host(html, count):
    assert len(loads(html)) == count


@pytest.mark.parametrize(
    ("command", "lines"),
    [
        pytest.param("ldls demo --out a", ["ldls demo --out a"], id="short"),
        pytest.param(
            f"ldls info {'a' * 80} --picture b.png", [f"ldls info {'a' * 80} \\", "    --picture b.png"], id="long"
        ),
    ],
)
def test_long_examples_are_broken_at_options(command, lines):
    assert wrapped(command).splitlines() == lines
