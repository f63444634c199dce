"""One node of a name per namespace and domain on a machine."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.nodes.main_loop import InstanceLock, last_holder, open_private, private_folder, take_priority


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("ROS_DOMAIN_ID", "77")


def test_a_second_holder_is_refused_with_the_first_ones_process() -> None:
    lock = InstanceLock("/gs1/antenna_servo")
    with pytest.raises(
        RuntimeError, match=rf"^/gs1/antenna_servo already runs in ROS domain 77 \(process {os.getpid()}\)$"
    ):
        InstanceLock("/gs1/antenna_servo")
    lock.release()
    InstanceLock("/gs1/antenna_servo").release()


def test_the_process_that_took_a_name_is_known_and_nobody_s_that_was_never_taken() -> None:
    assert last_holder("/gs1/antenna_servo") is None
    lock = InstanceLock("/gs1/antenna_servo")
    assert last_holder("/gs1/antenna_servo") == os.getpid()
    assert last_holder("/gs2/antenna_servo") is None
    lock.release()


def test_other_names_namespaces_and_domains_are_free(monkeypatch: pytest.MonkeyPatch) -> None:
    held = [InstanceLock("/gs1/antenna_servo"), InstanceLock("/gs2/antenna_servo"), InstanceLock("/gs1/rf_receiver")]
    monkeypatch.setenv("ROS_DOMAIN_ID", "78")
    held.append(InstanceLock("/gs1/antenna_servo"))
    for lock in held:
        lock.release()


def test_a_killed_holder_leaves_no_lock_behind() -> None:
    code = (
        "import sys, time; from rf_pointing.nodes.main_loop import InstanceLock;"
        "lock = InstanceLock('/gs1/antenna_servo'); print('held', flush=True); sys.stdin.read()"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(RuntimeError, match=rf"process {holder.pid}\)"):
        InstanceLock("/gs1/antenna_servo")
    holder.kill()
    holder.communicate()
    InstanceLock("/gs1/antenna_servo").release()


NAME = "/gs1/antenna_servo"


def test_locks_lie_in_the_user_s_runtime_directory_and_are_the_user_s_alone(tmp_path: Path) -> None:
    lock = InstanceLock(NAME)
    assert lock.path == tmp_path / "rf_pointing" / "domain77.gs1.antenna_servo.lock"
    assert lock.path.parent.stat().st_mode & 0o777 == 0o700
    assert lock.path.stat().st_mode & 0o777 == 0o600
    lock.release()
    # A folder that others may read is closed to them.
    lock.path.parent.chmod(0o777)
    InstanceLock(NAME).release()
    assert lock.path.parent.stat().st_mode & 0o777 == 0o700


def test_without_a_runtime_directory_locks_lie_in_the_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "nowhere"))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    stat = os.stat

    def no_session(path: str, **options: object) -> os.stat_result:
        if str(path).startswith("/run/user"):
            raise FileNotFoundError(2, "none", path)
        return stat(path, **options)

    monkeypatch.setattr(os, "stat", no_session)
    lock = InstanceLock(NAME)
    assert lock.path.parent == tmp_path / f"rf_pointing-{os.getuid()}"
    lock.release()


def test_a_link_that_somebody_has_put_there_is_not_followed(tmp_path: Path) -> None:
    """It used to be followed, and the file at its end was emptied."""
    precious = tmp_path / "precious"
    precious.write_text("ten years of observations")
    folder = tmp_path / "rf_pointing"
    folder.mkdir()
    (folder / "domain77.gs1.antenna_servo.lock").symlink_to(precious)
    with pytest.raises(RuntimeError, match=r"lock cannot be used: Too many levels of symbolic links$"):
        InstanceLock(NAME)
    assert last_holder(NAME) is None
    (folder / "domain77.gs1.antenna_servo.lock").unlink()
    os.link(precious, folder / "domain77.gs1.antenna_servo.lock")
    with pytest.raises(RuntimeError, match="must be a file of user [0-9]+ without another name"):
        InstanceLock(NAME)
    assert precious.read_text() == "ten years of observations"


def test_a_folder_that_is_a_link_or_somebody_else_s_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "rf_pointing").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RuntimeError, match="folder of locks .* cannot be used: "):
        InstanceLock(NAME)
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    with pytest.raises(RuntimeError, match="belongs to user [0-9]+, must belong to 12345"):
        private_folder(tmp_path / "elsewhere")


def test_a_pipe_in_the_place_of_a_file_does_not_hold_a_node_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RuntimeError, match="must be a file of user"):
        open_private(tmp_path / "pipe", os.O_RDWR)


def test_a_priority_that_is_not_permitted_is_told_and_nice_is_next(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, ...]] = []

    def refuse(*given: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "setpriority", lambda *given: asked.append(given))
    assert take_priority(0) == ""
    assert asked == []
    words = take_priority(20)
    assert words.startswith(
        "lifecycle.realtime_priority=20 is not permitted (Operation not permitted): nice -10 instead"
    )
    assert asked == [(os.PRIO_PROCESS, 0, -10)]
    monkeypatch.setattr(os, "setpriority", refuse)
    assert ", nor is nice -10" in take_priority(20)


def test_a_priority_that_is_permitted_is_that_of_every_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[int, tuple[int, int]] = {}
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda who, how, param: given.update({who: (how, param.sched_priority)})
    )
    assert take_priority(20) == ""
    assert os.getpid() in given
    assert set(given.values()) == {(os.SCHED_FIFO, 20)}


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ({"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}, "security"),
        ({"ROS_SECURITY_ENABLE": "True"}, "ROS_SECURITY_ENABLE=True must be true or false"),
        (
            {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "enforce"},
            "ROS_SECURITY_STRATEGY=enforce must be Enforce or Permissive",
        ),
    ],
)
def test_a_node_that_cannot_be_protected_as_requested_does_not_start(
    tmp_path: Path, variables: dict[str, str], words: str
) -> None:
    """An empty enclave: Fast DDS without security refuses to be secured, with it the keys are missing."""
    (tmp_path / "enclaves").mkdir()
    code = "from rf_pointing.nodes.rf_receiver import main; main()"
    environment = os.environ | {"ROS_SECURITY_KEYSTORE": str(tmp_path)} | variables
    ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2
    assert "rf_pointing: not started: " in ended.stderr
    assert words in ended.stderr
    assert "Traceback" not in ended.stderr
