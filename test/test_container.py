"""The Containerfile without a builder: what it copies exists and is enough, what it runs is what users run."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from test.test_documentation import launch_words

ROOT = Path(__file__).parents[1]
TEXT = re.sub(r"\\\n", " ", (ROOT / "Containerfile").read_text())
LINES = [tuple(line.split(maxsplit=1)) for line in TEXT.splitlines() if line and not line.startswith("#")]
CHECKED = "check_station dss13"
BUILT = "rf_pointing_msgs tf2_msgs"


def copies() -> list[tuple[list[str], str]]:
    """Return sources and target of every COPY from the checkout."""
    words = [rest.split() for word, rest in LINES if word == "COPY" and "--from" not in rest]
    return [(sources, target) for *sources, target in words]


def test_a_station_that_is_run_as_in_the_documents_has_a_user_of_its_own_and_a_volume() -> None:
    last = dict(LINES)
    assert last["USER"] == "rf_pointing"
    assert last["VOLUME"] == f"{last['ENV'].removeprefix('XDG_STATE_HOME=')}/rf_pointing"
    assert last["STOPSIGNAL"] == "SIGINT"
    final = TEXT[TEXT.rindex("FROM ") :]
    assert not re.search(r"g\+\+|cmake|make\b", final), "no compiler in what is run"
    # The command line is one of scripts/launch, which has its arguments.
    assert json.loads(last["ENTRYPOINT"]) == ["scripts/launch"]
    assert set(launch_words(json.loads(last["CMD"]))) >= {"station", "executive", "page", "rotctld"}
    assert json.loads(last["HEALTHCHECK"].partition("CMD ")[2]) == ["scripts/launch", "status"]
    readme = (ROOT / "README.md").read_text()
    for script in re.findall(r"scripts/\w+", TEXT):
        assert script in readme or script == "scripts/run"
        assert os.access(ROOT / script, os.X_OK)


def test_what_is_copied_is_enough_to_set_up_and_start_without_anything_of_this_shell(tmp_path: Path) -> None:
    """Wheels and messages are those of this checkout; the package is built from the copy, with an empty environment."""
    for sources, target in copies():
        for source in sources:
            place = tmp_path / Path(target).relative_to("/opt/rf_pointing")
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, place, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / source, place / source)
    state, own = tmp_path / ".ros", ROOT / ".ros"
    if not (own / "wheels").is_file():
        pytest.skip("no wheels here: a ROS 2 install")
    (state / "install").mkdir(parents=True)
    (state / "env").symlink_to((own / "env").resolve())
    shutil.copy(own / "wheels", state / "wheels")
    script = (
        f". '{tmp_path}/scripts/environment.sh'; need() {{ :; }}; "
        f'build_interfaces() {{ for one in {BUILT}; do cp -r "{own}/install/$one" "$STATE/install/" || true; done; }}; '
        f'enter_environment; "$STATE/install/rf_pointing/lib/rf_pointing/"{CHECKED}'
    )
    assert f"RUN scripts/run {CHECKED}" in TEXT
    done = subprocess.run(
        ["env", "-i", "PATH=/usr/bin:/bin", f"HOME={tmp_path}", "bash", "-euc", script], cwd="/", capture_output=True,
        text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "derived for band" in done.stdout
