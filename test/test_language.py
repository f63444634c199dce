"""Words that readers stumble over stay out of docstrings, comments, messages and documents.

`WORDS` are patterns of prose and what to write instead; `NAMES` are names of definitions.  To ban
another one, add a row.  Code spans in backquotes and code blocks are not prose, nor are strings
without a space, which are names.
"""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rf_pointing"
WORDS = {
    r"told": "published, reported, given", r"said": "reported, stated",
    r"asks|asked": "requests, requires, calls; asked for: requested",
    r"hears?|heard|hearing": "receive, received",
    r"listens?|listened|listening": "subscribe, receive", r"heeds?|heeded|heeding": "use, follow",
    r"stood": "was, stopped, was held",
    r"(stands?|standing) (beside|for itself|as one)": "is offset by; say what is meant",
    r"beside": "offset by (a direction); with, next to (a thing); in addition to",
    r"hangs? (on|together)|hung (on|together)|hanging (on|together)": "depend on; are correlated",
    r"hands? back|handed back|handing back": "hold-off (of sensors); return, release",
    r"holes?": "exclusion cone (of the mount); gap (in data)",
    r"refusals?": "reason (why not); rejection (of a measurement)",
    r"whole or not at all": "as one file; all or nothing: say what is atomic",
    r"speaks? (against|for|of)|spoke|spoken": "contradict, support, describe",
}  # fmt: skip
"""Pattern of whole words, and what to write; a space matches a line break too."""
NAMES = {
    "AxisPath": "Prediction", "Blend": "Transition", "BranchCourse": "TrackingBranch",
    "CommandIntake": "CommandHandler", "Course": "SlewPath",
    "Intake": "a name that says what is taken in and what becomes of it",
    "ModelFile": "ModelVersion", "Series": "TimeBuffer", "SkyOffsets": "PointingCorrections",
    "Tally": "PassStatistics", "Way": "Path", "refusal": "reason", "refusals": "reasons",
    "present_rad": "encoder_rad", "used_rad": "encoder_rad", "tally": "statistics",
    "Known": "PriorKnowledge: say of what", "One": "a name that says of what",
    "Selection": "TermSelection: say of what", "Table": "a name that says of what",
    "Suspect": "SystematicError", "Triangle": "NormalEquations", "WORDS": "PROTOCOLS",
    "Words": "DeviceProtocol", "day_plan": "multi_satellite_plan",
    "doubts": "outlying_passes, warnings, reasons", "situation": "expected_state",
    "suspects": "systematic_errors", "triangle": "normal_equations, equations",
}  # fmt: skip
"""Names of classes, functions, arguments, variables and attributes, and what to call them."""
NAMES_BELOW = {("ephemeris", "Motion"): "StateVector"}
"""The same for one folder: elsewhere the name is right."""
SPACED = [word.replace(" ", r"\s+") for word in WORDS]
PROSE = re.compile("|".join(rf"(?P<w{i}>\b(?:{word})\b)" for i, word in enumerate(SPACED)), re.IGNORECASE)
CODE_SPAN = re.compile(r"```.*?```|``[^`]+``|`[^`\n]+`|^::\n(?:\n|[ \t]+.*\n)+", re.DOTALL | re.MULTILINE)
REPLACED_FIELD = re.compile(r"\{[^{}]*\}")
STRINGS = {tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}


def blanked(pattern: re.Pattern[str], text: str) -> str:
    """Return `text` with what matches made blank, every line where it was."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def passages(path: Path) -> Iterator[tuple[int, str]]:
    """Yield first line and text of all prose in a file."""
    text = path.read_text()
    if path.suffix == ".py":
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT or (token.type in STRINGS and " " in token.string):
                yield token.start[0], blanked(REPLACED_FIELD, token.string)
    elif path.suffix in (".md", ".rst"):
        yield 1, text
    else:
        for number, line in enumerate(text.splitlines(), 1):
            yield number, line.partition("#")[2]


def banned_words(path: Path) -> list[str]:
    """Return file and line, word and replacement of every banned word of the prose of a file."""
    found = []
    replacements = list(WORDS.values())
    for first, text in passages(path):
        for match in PROSE.finditer(blanked(CODE_SPAN, text)):
            line = first + text.count("\n", 0, match.start())
            word = " ".join(match[0].split())
            replacement = replacements[int((match.lastgroup or "w0")[1:])]
            found.append(f"{shown(path)}:{line}: {word!r}, write: {replacement}")
    return found


WEAK = re.compile(
    r"\b(?:is|are|was|were)\s+(?-i:none)\b"
    r"|(?<!there\s)\b(?:is|are|was|were)\s+no\s+(?!longer\b|more\b|less\b|later\b|earlier\b|\w+er\s+than\b)\w+",
    re.IGNORECASE,
)
"""A definition by what a thing is not: say what it is, or what becomes of it."""
FRAGMENTS = re.compile(r"(?:Of|What|But)\b")
"""How a docstring does not begin: they leave the reader to find the noun that they belong to."""
FRAGMENTS_OF_COMMENTS = re.compile(r"# (?:Of|But)\b")


def weak_sentences(path: Path) -> list[str]:
    """Return file and line of definitions by negation, and of docstrings and comments without a verb."""
    found = []
    for first, text in passages(path):
        matches = WEAK.finditer(blanked(CODE_SPAN, text))
        found += [(first + text.count("\n", 0, match.start()), match[0]) for match in matches]
    if path.suffix == ".py":
        text = path.read_text()
        starts = [(node.lineno, node.value.value) for node in docstrings(ast.parse(text))]
        found += [(line, match[0]) for line, words in starts if (match := FRAGMENTS.match(words.strip()))]
        before = ""
        for number, line in enumerate(text.splitlines(), 1):
            # Only the first line of a comment begins a sentence.
            if not before.startswith("#") and (match := FRAGMENTS_OF_COMMENTS.match(line.strip())):
                found.append((number, match[0]))
            before = line.strip()
    return [f"{shown(path)}:{line}: {' '.join(words.split())!r}" for line, words in sorted(found)]


def docstrings(tree: ast.Module) -> list[ast.Expr]:
    """Return the docstrings of a module, those of its constants and attributes included."""
    bodies = (getattr(node, "body", None) for node in ast.walk(tree))
    strings = (each for body in bodies if isinstance(body, list) for each in body if isinstance(each, ast.Expr))
    return [each for each in strings if isinstance(each.value, ast.Constant) and isinstance(each.value.value, str)]


def lines_of_prose(path: Path) -> set[int]:
    """Return the numbers of the lines that are a docstring's or a comment alone."""
    text = path.read_text()
    found = {number for number, line in enumerate(text.splitlines(), 1) if line.lstrip().startswith("#")}
    for node in docstrings(ast.parse(text)):
        found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def banned_names(path: Path) -> list[str]:
    """Return file and line, name and replacement of every definition with a banned name."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        for name in defined(node):
            replacement = NAMES.get(name) or NAMES_BELOW.get((path.parent.name, name))
            if replacement:
                found.add((node.lineno, f"{shown(path)}:{node.lineno}: name {name!r}, write: {replacement}"))
    return [line for _, line in sorted(found)]


def defined(node: ast.AST) -> list[str]:
    """Return the name that a node of the syntax tree defines, if it defines one."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return [node.name]
    if isinstance(node, ast.arg):
        return [node.arg]
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        return [node.id]
    if isinstance(node, ast.ExceptHandler) and node.name:
        return [node.name]
    return [node.attr] if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) else []


def shown(path: Path) -> str:
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name


def rooms() -> dict[str, list[Path]]:
    """Return the files by room: a package of rf_pointing, a folder, or the documents at the root."""
    found: dict[str, list[Path]] = {}
    patterns = ("docs/**/*.md", "examples/*.py", "launch/*.py", "scripts/*.py", "config/*.yaml", "*.md", "*.rst")
    interfaces = [f"msg_defs/{kind}/*.{kind}" for kind in ("msg", "srv", "action")]
    for path in (path for pattern in (*patterns, *interfaces) for path in sorted(ROOT.glob(pattern))):
        parts = path.relative_to(ROOT).parts
        found.setdefault("/".join(parts[:-1][:2]) or "documents", []).append(path)
    for path in sorted(PACKAGE.rglob("*.py")):
        found.setdefault("/".join(path.relative_to(ROOT).parts[:-1][:3]), []).append(path)
    return dict(sorted(found.items()))


@pytest.mark.parametrize("room", rooms())
def test_prose_is_plain(room: str) -> None:
    found = [line for path in rooms()[room] for line in banned_words(path)]
    assert not found, "\n".join([f"{len(found)} in {room}", *found])


@pytest.mark.parametrize("room", rooms())
def test_sentences_say_what_a_thing_is(room: str) -> None:
    found = [line for path in rooms()[room] for line in weak_sentences(path)]
    assert not found, "\n".join([f"{len(found)} in {room}", *found])


@pytest.mark.parametrize("room", [room for room in rooms() if room.startswith("rf_pointing")])
def test_names_are_plain(room: str) -> None:
    found = [line for path in rooms()[room] for line in banned_names(path)]
    assert not found, "\n".join([f"{len(found)} in {room}", *found])


SAMPLE = '''"""A lag beside
the sigma told, see `told`."""


class Tally:
    word = "told"


def count(limit):
    # the antenna stood
    raise ValueError(f"{limit.asked} hangs  on it")
'''


def test_words_are_found_in_docstrings_comments_and_messages_and_nowhere_else(tmp_path: Path) -> None:
    (path := tmp_path / "sample.py").write_text(SAMPLE)
    found = [line.split(", write")[0] for line in banned_words(path)]
    assert found == [
        "sample.py:1: 'beside'", "sample.py:2: 'told'", "sample.py:10: 'stood'",
        "sample.py:11: 'hangs on'",
    ]  # fmt: skip


def test_names_are_found_where_they_are_defined(tmp_path: Path) -> None:
    (path := tmp_path / "sample.py").write_text(SAMPLE)
    assert banned_names(path) == ["sample.py:5: name 'Tally', write: PassStatistics"]


WEAK_SAMPLE = '''"""Of a text that is shown."""


def first():
    """Return None for a speed that is none, a value if there is no other."""
    # What is left here is no angle, and is no longer read.
    # Of this line nothing is known.


def second():
    """What follows."""
    # Of a lost drive nothing is known.
    return "a motion is no slower than its target"
'''


def test_weak_sentences_are_found_and_comparisons_are_not(tmp_path: Path) -> None:
    (path := tmp_path / "sample.py").write_text(WEAK_SAMPLE)
    assert weak_sentences(path) == [
        "sample.py:1: 'Of'", "sample.py:5: 'is none'", "sample.py:6: 'is no angle'",
        "sample.py:11: 'What'", "sample.py:12: '# Of'",
    ]  # fmt: skip


def test_code_in_a_document_is_not_prose(tmp_path: Path) -> None:
    (path := tmp_path / "page.md").write_text("```\ntold\n```\n`heard` but\nheard\n")
    assert [line.split(", ")[0] for line in banned_words(path)] == ["page.md:5: 'heard'"]


def test_only_comments_of_a_parameter_file_are_prose(tmp_path: Path) -> None:
    (path := tmp_path / "station.yaml").write_text("told: 1  # heard\n")
    assert [line.split(", ")[0] for line in banned_words(path)] == ["station.yaml:1: 'heard'"]
