"""One node of a name per namespace and domain on a machine."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from rf_pointing.nodes.main_loop import InstanceLock, last_holder


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
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
