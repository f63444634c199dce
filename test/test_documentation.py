"""The documents agree with the tree: links lead somewhere, indexes are complete, examples print what they state."""

import argparse
import ast
import importlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.station.description import STATIONS, station_from

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GENERATED = {"api.md", "parameters.md"}
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")])
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"```.*?```", re.DOTALL)
SPAN = re.compile(r"`([^`\n]+)`")
CITED = re.compile(
    r"(?<![\w/])([A-Z][A-Z0-9]+(?:-[A-Z0-9]+)?),? (?:eqs?\.|equations?|[Tt]ables?|[Ss]ections?|Figs?\.) \(?[\dIV]"
)
"""A source by its short name: capitals, followed by the number of an equation, table, section or figure."""
FOLDERS = "benchmarks|config|docs|examples|launch|msg_defs|requirements|rf_pointing|scripts|test"
PATH = re.compile(rf"(?<![\w/.~-])(?:{FOLDERS})/[\w./-]*\w")
"""A path of the tree in a code span or a code block; `runs/` and other results are not part of it."""


def shown(page: Path) -> str:
    return str(page.relative_to(ROOT))


def targets(page: Path) -> Iterator[str]:
    """Yield the targets of the relative links of a page."""
    for target in LINK.findall(CODE.sub("", page.read_text())):
        if not target.startswith(("http://", "https://", "mailto:")):
            yield target


def named_paths(page: Path) -> Iterator[str]:
    """Yield the paths that code spans and code blocks of a page name."""
    text = page.read_text()
    for code in [*CODE.findall(text), *SPAN.findall(CODE.sub("", text))]:
        yield from PATH.findall(code)


def anchor(heading: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    kept = re.sub(r"[^\w\- ]", "", heading.replace("`", "").strip().lower())
    return kept.replace(" ", "-")


def anchors(page: Path) -> set[str]:
    return {anchor(title) for title in re.findall(r"^#+ (.+)$", CODE.sub("", page.read_text()), re.MULTILINE)}


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_links_lead_to_a_file_and_a_heading(page: Path) -> None:
    broken = []
    for target in targets(page):
        path, _, heading = target.partition("#")
        found = (page.parent / path).resolve() if path else page
        if not found.exists() or (heading and found.suffix == ".md" and heading not in anchors(found)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_paths_that_are_named_exist(page: Path) -> None:
    # A file may be named by its stem: `benchmarks/lqg_tuning` has a .py and a .txt.
    missing = [path for path in set(named_paths(page)) if not (ROOT / path).exists()]
    assert not missing


@pytest.mark.parametrize(
    ("folder", "index"), [("decisions", "decisions/README.md"), ("math", "math/README.md"), (".", "README.md")]
)
def test_every_page_is_in_its_index(folder: str, index: str) -> None:
    page = DOCS / index
    linked = {(page.parent / target.partition("#")[0]).resolve() for target in targets(page)}
    pages = {path.resolve() for path in (DOCS / folder).glob("*.md")} - {page.resolve()}
    assert not {path.name for path in pages - linked}


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, left = set(), [ROOT / "README.md"]
    while left:
        page = left.pop()
        if page not in reached:
            reached.add(page)
            found = ((page.parent / target.partition("#")[0]).resolve() for target in targets(page))
            left += [path for path in found if path.suffix == ".md" and path.exists()]
    assert not {shown(page) for page in PAGES if page.resolve() not in reached}


@pytest.mark.parametrize("page", [page for page in PAGES if page.name not in GENERATED], ids=shown)
def test_lines_of_prose_are_at_most_100_columns(page: Path) -> None:
    lines = CODE.sub(lambda match: "\n" * match[0].count("\n"), page.read_text()).splitlines()
    # A row of a table, a formula and a picture cannot be wrapped.
    free = ("|", "  ", "![")
    long = [number for number, line in enumerate(lines, 1) if len(line) > 100 and not line.startswith(free)]
    assert not long


def block(name: str) -> str:
    """Return the code block between two marker comments of the page of first steps."""
    text = (DOCS / "getting_started.md").read_text()
    found = re.search(rf"<!-- {name} -->\n```\w*\n(.*?)```\n<!-- /{name} -->", text, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_first_steps_are_the_example() -> None:
    assert block("first steps") == (ROOT / "examples/first_steps.py").read_text()


def test_the_first_steps_print_what_the_page_states() -> None:
    run = subprocess.run(
        [sys.executable, "examples/first_steps.py"], cwd=ROOT, capture_output=True, text=True, check=True, timeout=120
    )
    assert run.stdout == block("output")


def test_every_source_that_is_cited_by_equation_or_table_is_in_the_bibliography() -> None:
    listed = " ".join(re.findall(r"^\*\*(.+?)\*\*", (DOCS / "bibliography.md").read_text(), re.MULTILINE))
    cited = set()
    for path in [*(ROOT / "rf_pointing").rglob("*.py"), *DOCS.rglob("*.md")]:
        cited.update(CITED.findall(path.read_text()))
    assert cited
    assert not {name for name in cited if name not in listed}


def declared_parameters() -> dict[str, set[str]]:
    """Return the names of the generated parameter page, by node."""
    sections = re.split(r"^## ", (DOCS / "parameters.md").read_text(), flags=re.MULTILINE)[1:]
    return {text.split()[0]: set(re.findall(r"^\| `([\w.]+)` \|", text, re.MULTILINE)) for text in sections}


@pytest.mark.parametrize("page", [page for page in PAGES if "```yaml" in page.read_text()], ids=shown)
def test_parameters_of_an_example_file_are_declared(page: Path, tmp_path: Path) -> None:
    declared = declared_parameters()
    for number, text in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)):
        (file := tmp_path / f"{number}.yaml").write_text(text)
        if "ros__parameters" not in text:
            # A station description, or a part of one under the head of a shipped one.
            head = "" if text.startswith("version:") else (STATIONS / "leo_3m7.yaml").read_text()
            station_from(file, head + text)
            continue
        for node, given in read_parameter_files([file]).items():
            assert not set(given) - declared[node], node


@pytest.mark.parametrize("page", [page for page in PAGES if "```python" in page.read_text()], ids=shown)
def test_python_in_a_page_imports_names_that_exist(page: Path) -> None:
    for text in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        imports = [node for node in ast.parse(text).body if isinstance(node, ast.ImportFrom)]
        for node in imports:
            if node.module and node.module.startswith("rf_pointing"):
                module = importlib.import_module(node.module)
                assert not [name.name for name in node.names if not hasattr(module, name.name)]


def test_glossary_is_in_alphabetical_order() -> None:
    terms = re.findall(r"^\*\*(.+?)\*\*", (DOCS / "glossary.md").read_text(), re.MULTILINE)
    assert terms == sorted(terms, key=str.casefold)


CONTINUED = re.compile(r"\\\n\s*")
OPERATORS = {"|", "||", "&&", "&", ";", ">", ">>", "2>"}
PLACEHOLDERS = {"N": "1", "SEED": "1", "FOLDER": "tracking"}
WRAPPERS = {"scripts/track": "track", "scripts/calibrate": "calibrate"}
RUNNERS = (("scripts/run",), ("ros2", "run", "rf_pointing"), ("rf-pointing",))


def executables() -> dict[str, str]:
    """Return the module of every executable, from setup.py."""
    text = (ROOT / "setup.py").read_text()
    (table,) = re.findall(r"^EXECUTABLES = (\{.*?^\})", text, re.MULTILINE | re.DOTALL)
    return {name: f"rf_pointing.{room}.{name}" for room, names in ast.literal_eval(table).items() for name in names}


def command_lines(page: Path) -> Iterator[list[str]]:
    """Yield the words of every command of the code blocks and code spans of a page, without what the shell takes."""
    text = page.read_text()
    blocks = [CONTINUED.sub(" ", block[:-3].partition("\n")[2]) for block in CODE.findall(text)]
    rest = CONTINUED.sub(" ", CODE.sub("", text))
    lines = [line for block in blocks for line in block.splitlines()]
    for line in [*lines, *SPAN.findall(rest), *re.findall(r"^ {4,}(\S.*)$", rest, re.MULTILINE)]:
        try:
            words = shlex.split(line, comments=True)
        except ValueError:
            # A line of another language: a quote that is not closed.
            continue
        command: list[str] = []
        for word in [*words, ";"]:
            if word in OPERATORS:
                if command:
                    yield command
                command = []
            elif command or not re.fullmatch(r"[A-Z_]+=.*", word):
                command.append(PLACEHOLDERS.get(word, word).strip("[]"))


def program_of(command: list[str]) -> tuple[str, list[str]]:
    """Return name and arguments of a program of ours, or "" for another command."""
    for runner in RUNNERS:
        if tuple(command[: len(runner)]) == runner and len(command) > len(runner):
            return command[len(runner)], command[len(runner) + 1 :]
    return WRAPPERS.get(command[0], ""), command[1:]


class _ParsedError(BaseException):
    """Ends a program once its arguments are parsed."""


def parse(name: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the program parse its arguments, and nothing more; SystemExit for what it refuses."""
    original = argparse.ArgumentParser.parse_args

    def parsed(parser: argparse.ArgumentParser, *given: object, **named: object) -> None:
        original(parser, *given, **named)
        assert not parser.allow_abbrev, "--model of one program would be --models of another"
        raise _ParsedError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parsed)
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    with pytest.raises(_ParsedError):
        importlib.import_module(executables()[name]).main()


OURS = [(page, *program_of(command)) for page in PAGES for command in command_lines(page)]


@pytest.mark.parametrize(
    ("page", "name", "arguments"),
    [pytest.param(*each, id=f"{shown(each[0])}: {shlex.join(each[1:2] + tuple(each[2]))}")
     for each in OURS if each[1] not in ("", "NAME")],
)  # fmt: skip
def test_a_command_line_is_one_that_its_program_takes(
    page: Path, name: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert name in executables(), page
    if ".nodes." in executables()[name] or arguments == ["--help"]:
        return
    pytest.importorskip("rclpy", reason="commands need ROS 2")
    monkeypatch.chdir(tmp_path)
    try:
        parse(name, arguments, monkeypatch)
    except SystemExit:
        pytest.fail(capsys.readouterr().err)


def test_a_command_line_with_an_unknown_option_is_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("rclpy", reason="commands need ROS 2")
    (page := tmp_path / "page.md").write_text(
        "```\nX=1 scripts/run plan_passes \\\n  --params-file a.yaml > b  # c\n```\n"
    )
    ((name, arguments),) = [program_of(command) for command in command_lines(page) if command[0] != "b"]
    assert (name, arguments) == ("plan_passes", ["--params-file", "a.yaml"])
    with pytest.raises(SystemExit):
        parse(name, arguments, monkeypatch)
    assert "unrecognized arguments: --params-file" in capsys.readouterr().err


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_options_of_a_script_are_in_the_script(page: Path) -> None:
    missing = []
    for command in command_lines(page):
        if command[0] == "scripts/house":
            command = ["scripts/run-python", "scripts/house.py", *command[1:]]
        if command[0] != "scripts/run-python" or not command[1:] or not command[1].endswith(".py"):
            continue
        source = (ROOT / command[1]).read_text()
        options = [word for word in command[2:] if word.startswith("--")]
        missing += [f"{command[1]} {option}" for option in options if f'"{option}"' not in source]
    assert not missing


LAUNCHED = re.compile(r"(ros2 launch rf_pointing|scripts/launch) (\w+)(?:\.launch\.py)?((?: [\w.]+:=[^\s`\"]+)*)")
"""A line that starts a station: by the tool of ROS or by the script, the launch file, its arguments."""


def launch_words(words: list[str]) -> dict[str, object]:
    """Return the values of a command line of scripts/launch; ValueError for what it does not take."""
    launch = pytest.importorskip("rf_pointing.commands.launch", reason="launch files need ROS 2")
    file, given = launch.launch_file(words[0]), launch.pairs(words[1:])
    named = {} if "station" not in [argument.name for argument in file.arguments] else {"station": "my_dish.yaml"}
    return dict(file.values(named | given))


@pytest.mark.parametrize(
    "page",
    [
        *PAGES,
        *sorted((ROOT / "launch").glob("*.py")),
        *sorted((ROOT / "examples").glob("*.py")),
        ROOT / "config/systemd/station.conf",
    ],
    ids=shown,
)
def test_whoever_has_no_ros2_launch_reads_the_line_of_scripts_launch(page: Path) -> None:
    """Each line with the one stands beside the same line with the other, and its arguments are taken."""
    found: dict[str, set[tuple[str, str]]] = {"ros2 launch rf_pointing": set(), "scripts/launch": set()}
    for tool, name, words in LAUNCHED.findall(page.read_text()):
        if name not in ("status", "stop", "NAME"):
            found[tool].add((name, words))
            launch_words([name, *words.split()])
    assert found["ros2 launch rf_pointing"] <= found["scripts/launch"]
