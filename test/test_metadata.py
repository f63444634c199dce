"""Metadata that a maintainer relies on: keys, dependencies, names, licenses, changelogs, and units on the wire."""

import ast
import re
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PACKAGES = {"rf_pointing": ROOT, "rf_pointing_msgs": ROOT / "msg_defs"}
KEYS = yaml.safe_load((ROOT / "test/data/rosdep_noble.yaml").read_text())
INTERFACES = sorted((ROOT / "msg_defs").glob("*/*.*"))
LIBRARY_OF = {
    "astropy_iers_data": "astropy-iers-data", "erfa": "pyerfa", "serial": "python3-serial", "yaml": "python3-yaml",
    "markupsafe": "python3-jinja2", "urllib3": "python3-requests",
}  # fmt: skip
"""Key, or library without one, of modules that are named otherwise."""
OPTIONAL = {"SoapySDR", "dask", "distributed", "pandas", "pyarrow", "zmq"}
"""Used where they are installed."""
UNIT = re.compile(
    r"\b(rad|s|m|K|W|V|A|Hz|dB|dBm|dB-Hz|kg|N|deg|lane|lanes|cycles?|counts?|1|share|radians?|unit|ratio|frequency received"
    r"|cosines|power|in \[0, 1\]|0 at|beamwidths?|times|quaternion|number of|C/N0)\b"
)
"""A unit, or the word for a number that has none."""


def dependencies(package: str, *tags: str) -> set[str]:
    text = (PACKAGES[package] / "package.xml").read_text()
    return set(re.findall(rf"<(?:{'|'.join(tags or [r'[a-z_]*depend'])})>([^<]+)</", text))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_key_resolves_on_ubuntu(package: str) -> None:
    unknown = dependencies(package) - KEYS.keys() - PACKAGES.keys()
    assert not unknown, "see test/data/rosdep_noble.md"


def test_no_key_is_stored_for_nothing() -> None:
    assert set(KEYS) <= dependencies("rf_pointing") | dependencies("rf_pointing_msgs")


def imported(folder: Path) -> set[str]:
    """Return the packages outside the standard library that modules below a folder import."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(str(node.module).partition(".")[0])
    return found - sys.stdlib_module_names - {"rf_pointing"}


def test_whatever_is_imported_is_named_as_a_dependency() -> None:
    """A key of package.xml, or a library of requirements/runtime.txt, which has no key."""
    named = dependencies("rf_pointing", "depend", "exec_depend")
    lines = (ROOT / "requirements/runtime.txt").read_text().splitlines()
    without_key = {line.partition("==")[0] for line in lines if "==" in line}
    for module in imported(ROOT / "rf_pointing") | imported(ROOT / "launch"):
        names = {module, f"python3-{module}", LIBRARY_OF.get(module, module)}
        assert names & (named | without_key | OPTIONAL), module


def test_names_follow_rep_144() -> None:
    for package in PACKAGES:
        assert re.fullmatch(r"[a-z](?!.*__)[a-z0-9_]*[a-z0-9]", package)
    for path in INTERFACES:
        assert re.fullmatch(r"[A-Z][A-Za-z0-9]+", path.stem), path
        for name, _ in fields(path):
            assert re.fullmatch(r"[a-z](?!.*__)[a-z0-9_]*[a-z0-9]|[A-Z][A-Z0-9_]*", name), (path.name, name)


def fields(path: Path) -> list[tuple[str, str]]:
    """Return name and type with comment of every field of an interface."""
    found = []
    for line in path.read_text().splitlines():
        if line.strip() and not line.lstrip().startswith(("#", "---")):
            kind, rest = line.split(maxsplit=1)
            found.append((re.split(r"[ =#]", rest, maxsplit=1)[0], f"{kind} {rest.partition('#')[2].strip()}"))
    return found


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_every_field_says_what_it_is_and_in_which_unit(path: Path) -> None:
    for name, text in fields(path):
        kind, _, comment = text.partition(" ")
        if name.isupper():
            continue  # a constant is a word of the field that follows it
        assert comment, f"{path.name}: {name} has no comment"
        if kind.startswith("float"):
            assert UNIT.search(comment), f"{path.name}: {name} has no unit: {comment}"


# Of docutils, which catkin_pkg calls.
@pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")
@pytest.mark.parametrize("package", PACKAGES)
def test_manifests_and_changelogs_are_those_that_bloom_reads(package: str) -> None:
    catkin = pytest.importorskip("catkin_pkg.package")
    from catkin_pkg.changelog import get_changelog_from_path
    from catkin_pkg.cli.prepare_release import get_forthcoming_label

    warnings: list[str] = []
    manifest = catkin.parse_package(str(PACKAGES[package] / "package.xml"), warnings=warnings)
    assert warnings == []
    assert manifest.name == package
    changelog = get_changelog_from_path(str(PACKAGES[package]), package)
    assert changelog.package_name == package
    # What catkin_prepare_release gives the number of the version.
    assert get_forthcoming_label(changelog.rst) == "Forthcoming"


def test_one_license_counts_for_every_file() -> None:
    text = (ROOT / "LICENSE").read_text()
    assert "Apache License" in text
    assert "Version 2.0, January 2004" in text
    for folder in PACKAGES.values():
        assert (folder / "LICENSE").read_text() == text
        assert '<license file="LICENSE">Apache-2.0</license>' in (folder / "package.xml").read_text()
    assert 'license="Apache-2.0"' in (ROOT / "setup.py").read_text()
    # One way: a header in some files would leave open what counts for the others.
    for path in (*(ROOT / "rf_pointing").rglob("*.py"), *INTERFACES):
        assert "Licensed under" not in path.read_text()[:1000], path
