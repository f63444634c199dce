"""One node of a name per namespace and domain on a machine."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
import rclpy
from rclpy.action import ActionClient
from rf_pointing_msgs.action import RunSchedule

from rf_pointing.ros import main_loop
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.main_loop import InstanceLock, last_holder, private_folder, take_priority
from rf_pointing.ros.managed import ManagedNode

NAME = "/gs1/antenna_servo"


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


def test_other_names_namespaces_and_domains_are_free(monkeypatch: pytest.MonkeyPatch) -> None:
    held = [InstanceLock("/gs1/antenna_servo"), InstanceLock("/gs2/antenna_servo"), InstanceLock("/gs1/rf_receiver")]
    monkeypatch.setenv("ROS_DOMAIN_ID", "78")
    held.append(InstanceLock("/gs1/antenna_servo"))
    for lock in held:
        lock.release()


def test_a_killed_holder_leaves_no_lock_behind() -> None:
    code = (
        "import sys, time; from rf_pointing.ros.main_loop import InstanceLock;"
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


@pytest.mark.parametrize("fault", ["missing", "owner", "closed"])
def test_without_a_runtime_directory_of_the_user_locks_lie_in_the_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "temporary"))
    stat = os.stat

    def found(path: Any, **options: Any) -> Any:
        if Path(str(path)) not in (tmp_path, Path(f"/run/user/{os.getuid()}")):
            return stat(path, **options)
        if fault == "missing":
            raise FileNotFoundError(2, "none", path)
        return SimpleNamespace(st_uid=os.getuid() + (fault == "owner"))

    monkeypatch.setattr(os, "stat", found)
    monkeypatch.setattr(os, "access", lambda _path, mode: mode == os.W_OK and fault != "closed")
    lock = InstanceLock(NAME)
    assert lock.path.parent == tmp_path / "temporary" / f"rf_pointing-{os.getuid()}"
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


class Node:
    """A node that notes what the loop does with it; `raises` names the calls that fail."""

    def __init__(self, deaf_after: int = 0, raises: tuple[str, ...] = (), name: str = "node") -> None:
        self.did: list[str] = []
        self.failure: Exception | None = None
        self.brings_itself_up = False
        self.raises, self.turns, self.deaf_after, self.waitables = raises, 0, deaf_after, ()
        self.lock = SimpleNamespace(release=lambda: self.did.append("release"))
        self.get_name, self.checks = lambda: name, dict[str, Any]()
        self.diagnostics = SimpleNamespace(add=self.checks.__setitem__)

    @property
    def input_watchdog(self) -> Any:
        deaf = bool(self.deaf_after) and self.turns >= self.deaf_after
        return SimpleNamespace(deaf="nothing has been received" if deaf else "")

    def do(self, name: str) -> None:
        self.did.append(name)
        if name.partition(" ")[0] in self.raises:
            raise RuntimeError(f"{name.partition(' ')[0]} has failed")

    def bring_up(self) -> None:
        self.do("bring_up")

    def turn(self) -> float:
        self.turns += 1
        return 0.01 * self.turns

    def catch_up(self, late_s: float = 0.0) -> None:
        self.do(f"catch_up {late_s}" if late_s else "catch_up")

    def fail(self, reason: str) -> None:
        self.do(f"fail {reason}")

    def end(self) -> None:
        self.do("end")

    def destroy_node(self) -> None:
        self.do("destroy")

    def survived(self, where: str, error: Exception) -> None:
        self.do(f"survived {where}: {error}")

    def get_logger(self) -> Any:
        return SimpleNamespace(fatal=lambda words: self.did.append(f"fatal {words.splitlines()[0]}"))


class Executor:
    """Spins without ROS; after `rounds` a signal has come.  `failed` is a node whose periodic work raises."""

    def __init__(
        self, signals: list[int], rounds: int, error: Exception | None = None, failed: Node | None = None,
        meanwhile: Any = None,
    ) -> None:  # fmt: skip
        self.meanwhile = meanwhile or (lambda: None)
        self.signals, self.rounds, self.error, self.failed = signals, rounds, error, failed
        self.waits, self.nodes = list[float](), list[Node]()
        self.add_node, self.remove_node = self.nodes.append, self.nodes.remove

    def spin_once(self, timeout_sec: float) -> None:
        self.waits.append(timeout_sec)
        self.meanwhile()
        if len(self.waits) == self.rounds:
            self.signals.append(2)
        if self.error is not None:
            if self.failed is not None:
                self.failed.failure = self.error
            raise self.error


def work(node: Node, executor: Executor) -> int:
    return main_loop.NodeLoop([lambda: node], executor, executor.signals).work()


LEAVES = ["end", "destroy", "release"]


def test_the_loop_turns_and_waits_until_a_signal_or_the_node_is_deaf() -> None:
    node, executor = Node(), Executor([], 3)
    assert work(node, executor) == 0
    assert executor.waits == pytest.approx([0.01, 0.02, 0.03])
    assert node.did == ["bring_up", "bring_up", "bring_up", *LEAVES]
    node, executor = Node(deaf_after=2), Executor([], 9)
    assert work(node, executor) == main_loop.DEAF
    assert node.turns == 2
    assert node.did[-3].startswith("fatal the node ends, and must be started again: nothing has been received")
    assert node.did[-2:] == ["end", "release"]


def test_work_that_no_timer_has_called_is_done_once_nothing_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = SimpleNamespace(s=0.0)
    monkeypatch.setattr(main_loop, "time", SimpleNamespace(monotonic=lambda: wall.s))
    node, executor = Node(), Executor([], 3, meanwhile=lambda: setattr(wall, "s", wall.s + 0.001))
    work(node, executor)
    assert "catch_up" not in node.did, "an event came before the end of each wait"
    node, executor = Node(), Executor([], 10, meanwhile=lambda: setattr(wall, "s", wall.s + 0.09))
    node.turn = lambda: 0.1
    work(node, executor)
    assert node.did.count("catch_up 0.3") == 2, "never idle: what has been due for long"
    assert "catch_up" not in node.did
    node, executor = Node(), Executor([], 4)
    executor.meanwhile = lambda: setattr(wall, "s", wall.s + executor.waits[-1])
    work(node, executor)
    # Waits of 10, 20, 30 and 40 ms: of two of IDLE_S the second and third are over.
    assert node.did.index("catch_up") == 4
    assert node.did.count("catch_up") == 1


@pytest.mark.parametrize(
    ("raises", "failure", "ends"),
    [
        (("bring_up",), "RuntimeError: bring_up has failed", ["fail RuntimeError: bring_up has failed", *LEAVES]),
        (("end",), "RuntimeError: end has failed", LEAVES),
        (
            ("bring_up", "fail"),
            "RuntimeError: fail has failed",
            ["fail RuntimeError: bring_up has failed", *LEAVES[1:]],
        ),
    ],
)
def test_an_error_of_the_node_s_own_work_is_a_failure(raises: tuple[str, ...], failure: str, ends: list[str]) -> None:
    node = Node(raises=raises)
    assert work(node, Executor([], 1)) == 1
    assert [each for each in node.did if not each.startswith(("fatal", "bring_up"))] == ends
    assert f"fatal the node ends after a controlled stop, please report it: {failure}" in node.did


def run_program(code: str, *words: str) -> Any:
    given = [sys.executable, "-c", "import sys, time\nfrom rf_pointing.ros import main_loop\n" + code, *words]
    return subprocess.run(given, capture_output=True, text=True, timeout=60.0)


def test_a_process_that_hangs_ends_and_says_where_and_one_that_comes_round_does_not() -> None:
    """A regular expression that does not end holds the lock of all threads, as a lost read of a disk would."""
    ended = run_program(
        "import re\nwatch = main_loop.HangWatch(1.0)\n"
        "for _ in range(30):\n    watch.come_round()\n    time.sleep(0.05)\n"
        "print('came round', flush=True)\nre.match(r'(a+)+$', 'a' * 50 + 'b')\n"
    )
    assert (ended.returncode, ended.stdout) == (1, "came round\n")
    assert "Timeout" in ended.stderr
    assert 'File "<string>", line 9 in <module>' in ended.stderr


def test_a_call_that_computes_with_the_lock_of_all_threads_ends_the_process_and_one_without_does_not() -> None:
    ended = run_program(
        "import hashlib, re\nmain_loop.LOCKED_S, main_loop.LOOK_S = 0.5, 0.05\n"
        "watch = main_loop.HangWatch()\nwatch.begin(watch.begin.__code__)\n"
        "while time.process_time() < 3.0:\n    hashlib.pbkdf2_hmac('sha256', b'', b'', 10**6)\n"
        "print('computed', flush=True)\nre.match(r'(a+)+$', 'a' * 50 + 'b')\n"
    )
    assert (ended.returncode, ended.stdout) == (-signal.SIGPROF, "computed\n")
    assert 'File "<string>", line 10 in <module>' in ended.stderr


def test_a_write_that_hangs_ends_the_process_sooner() -> None:
    ended = run_program(
        "main_loop.WRITTEN_S = 0.5\nwatch = main_loop.HangWatch()\nwith watch.writing():\n    pass\ntime.sleep(1.5)\n"
        "print('written', flush=True)\nwith watch.writing():\n    time.sleep(60.0)\n"
    )
    assert (ended.returncode, ended.stdout) == (1, "written\n")


def test_a_wait_for_events_that_does_not_end_ends_the_process_and_long_work_does_not() -> None:
    ended = run_program(
        "main_loop.STUCK_S = main_loop.LOOK_S = 0.2\n"
        "def long_work():\n    time.sleep(1.5)\n    print('worked', flush=True)\n"
        "def loop(*calls):\n    for call, *given in calls:\n"
        "        watch.come_round()\n        call(*given)\n"
        "watch = main_loop.HangWatch()\nwatch.begin(loop.__code__)\n"
        "loop(*[(time.sleep, 0.05)] * 20, (long_work,), (time.sleep, 60.0))\n"
    )
    assert (ended.returncode, ended.stdout) == (1, "worked\n")
    assert "Timeout (0:00:00)! A wait for events does not end." in ended.stderr


OWN_NODE = "main_loop.run(lambda: [thread.start(), managed.ManagedNode('made')][1])"
DRIVER = (
    "from rf_pointing.ros import driver_node as d; rclpy.init(); thread.start(); d.spin_watched(rclpy.create_node('d'))"
)


@pytest.mark.parametrize(
    ("thread", "loops", "code", "turned"),
    [("dds.udp.7411", 10**8, main_loop.DEAF, OWN_NODE), ("dds.udp.7411", 10**4, 0, OWN_NODE),
     ("a) b", 10**6, 0, OWN_NODE), ("dds.udp.7411", 10**8, main_loop.DEAF, DRIVER), ("dds.udp.7411", 10**4, 0, DRIVER)],
)  # fmt: skip
def test_a_thread_of_dds_that_never_waits_ends_the_node(thread: str, loops: int, code: int, turned: str) -> None:
    """The processor time of the thread between two of its waits counts, here without Python's lock."""
    ended = run_program(
        "import hashlib, os, rclpy, threading\nfrom rf_pointing.ros import managed\n"
        "main_loop.COMPUTED_S, main_loop.LOOK_S = 0.2, 0.05\ndef compute():\n"
        f"    open(f'/proc/self/task/{{threading.get_native_id()}}/comm', 'w').write({thread!r})\n"
        "    while time.thread_time() < 1.0:\n"
        f"        hashlib.pbkdf2_hmac('sha256', b'', b'', {loops})\n        time.sleep(0.001)\n"
        "    os.kill(os.getpid(), 15)\nthread = threading.Thread(target=compute, daemon=True)\n"
        f"{turned}\n"
    )
    assert ended.returncode == code, ended.stderr
    assert (f"{thread} has computed for 0.2 s and never waited" in ended.stderr) == bool(code)


@pytest.mark.parametrize(
    "phase", ["watch.begin(run.__code__)", "watch.come_round()\nwatch.begin_end()\nwith watch.writing(): pass"]
)
def test_a_start_or_an_end_that_hangs_ends_the_process_and_one_in_time_has_its_own_code(phase: str) -> None:
    code = (
        "main_loop.START_OR_END_S = 1.0\nrun = main_loop.run\n"
        f"watch = main_loop.HangWatch()\n{phase}\ntime.sleep(float(sys.argv[1]))\nsys.exit(3)\n"
    )
    for seconds, status in (("0", 3), ("60", 1)):
        assert run_program(code, seconds).returncode == status


def test_an_error_of_a_callback_is_survived_and_one_of_periodic_work_is_not() -> None:
    node = Node()
    assert work(node, Executor([], 2, ValueError("no time"))) == 0
    assert node.did == ["bring_up", "survived a callback: no time"] * 2 + LEAVES
    node = Node()
    executor = Executor([], 5, KeyError("gone"), node)
    assert work(node, executor) == 1
    assert (node.turns, node.did[-4:]) == (1, ["fail KeyError: 'gone'", *LEAVES])


def test_of_several_nodes_one_that_fails_is_made_again_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """After half a second, and again after one in which it cannot be made; the others work on all the time."""
    wall, made, signals = SimpleNamespace(s=0.0), list[Node](), list[int]()
    monkeypatch.setattr(main_loop, "time", SimpleNamespace(monotonic=lambda: wall.s))

    def make() -> Node:
        if len(made) == 1 and wall.s < 1.2:
            raise RuntimeError("/gs1/bad already runs")
        made.append(Node(raises=("bring_up",) if not made else (), name="bad"))
        return made[-1]

    other, executor = Node(name="other"), Executor(signals, 30, meanwhile=lambda: setattr(wall, "s", wall.s + 0.1))
    loop = main_loop.NodeLoop([lambda: other, make], executor, signals, restart=True)
    assert loop.work() == 0
    assert [each.brings_itself_up for each in (*made, other)] == [False, True, False]
    assert made[0].did[-4:] == ["fail RuntimeError: bring_up has failed", *LEAVES]
    assert made[1].turns == pytest.approx(15, abs=2)
    assert other.turns == pytest.approx(31, abs=1)
    health = other.checks["process"]()
    assert (health.level, health.message, health.values["restarts bad"]) == (WARN, "bad was started again", 1)


def test_a_node_that_holds_up_the_others_of_its_process_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = SimpleNamespace(s=0.0)
    monkeypatch.setattr(main_loop, "time", SimpleNamespace(monotonic=lambda: wall.s))
    signals, node = list[int](), Node()
    executor = Executor(signals, 1, meanwhile=lambda: setattr(wall, "s", 3.0))
    main_loop.NodeLoop([lambda: node], executor, signals, restart=True).work()
    assert node.checks["process"]().message == "one node has held up its process for 3.0 s"
    wall.s += main_loop.STALL_SHOWN_S + 1.0
    assert node.checks["process"]().level == OK


class Fragile(ManagedNode):
    """Fails with its first work, when it lives for the first time."""

    lives: ClassVar[list[str]] = []

    def __init__(self) -> None:
        super().__init__("fragile")
        self.lives.append("made")
        self.serve_goals(
            RunSchedule, "act", accepts=lambda _: True, begin=lambda goal: goal.execute(), cancel=lambda: None,
            result=RunSchedule.Result,
        )  # fmt: skip

    def activate(self) -> None:
        self.every(0.02, self.tick)

    def tick(self, _t_s: float) -> None:
        if len(self.lives) == 1:
            raise KeyError("first")

    def fail(self, reason: str) -> None:
        self.lives.append(reason)


def test_a_live_node_that_has_failed_is_back_with_its_action_while_the_others_go_on(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    signals, begun_s = list[int](), time.monotonic()

    class Other(ManagedNode):
        def __init__(self) -> None:
            super().__init__("other")
            self.client, self.answer = ActionClient(self, RunSchedule, "act"), None

        def turn(self) -> float:
            assert time.monotonic() < begun_s + 60.0, Fragile.lives
            if len(Fragile.lives) == 3 and self.client.server_is_ready():
                self.answer = self.answer or self.client.send_goal_async(RunSchedule.Goal())
                # The action of the node that has failed would take its goals.
                alone = self.count_services("/act/_action/send_goal") == 1
                if alone and self.answer.done() and self.answer.result().accepted:
                    signals.append(2)
            return 0.02

    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    rclpy.init(args=["--ros-args", "-p", "lifecycle.autostart:=true"])
    executor = main_loop.make_executor()
    try:
        assert main_loop.NodeLoop([Other, Fragile], executor, signals, restart=True).work() == 0
    finally:
        executor.shutdown()
        rclpy.try_shutdown()
    assert Fragile.lives == ["made", "KeyError: 'first'", "made"]


@pytest.mark.parametrize(("given", "code"), [("", None), ("deaf", 3), ("work", 1)])
def test_the_exit_code_of_a_process_says_how_it_ended(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, given: str, code: int | None
) -> None:
    class Made(ManagedNode):
        def __init__(self) -> None:
            super().__init__("made")

        def turn(self) -> float:
            os.kill(os.getpid(), signal.SIGTERM)
            if given == "deaf":
                self.input_watchdog.deaf = "silent"
            elif given:
                raise KeyError(given)
            return 0.01

    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setattr(sys, "argv", ["node", "--ros-args", "-p", "lifecycle.autostart:=true"])
    # Where DDS no longer receives, the process is left without its end.
    monkeypatch.setattr(main_loop, "leave", sys.exit)
    kept = signal.getsignal(signal.SIGTERM)
    try:
        if code is None:
            main_loop.run(Made)
        else:
            with pytest.raises(SystemExit) as left:
                main_loop.run(Made)
            assert left.value.code == code
    finally:
        main_loop.faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGTERM, kept)
    assert rclpy.ok() == (given == "deaf")
    rclpy.try_shutdown()
    InstanceLock("/made").release()


@pytest.mark.parametrize("word", ["-h", "--help"])
def test_help_is_given_beside_other_arguments(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], word: str
) -> None:
    monkeypatch.setattr(sys, "argv", ["node", "other", word])
    with pytest.raises(SystemExit) as left:
        main_loop.run(Node)
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith(f"{__doc__}\nusage: ")


def test_every_logger_of_a_process_writes_json_where_it_is_chosen() -> None:
    program = (
        "import rclpy; from rf_pointing.ros.main_loop import log_as_chosen; log_as_chosen(); rclpy.init();"
        "log = rclpy.create_node('quoting').get_logger(); log.warn('a \"b\"\\\\\\n c'); log.info('plain')"
    )
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60.0, check=True,
        env={**os.environ, "RF_POINTING_LOG": "json"},
    )  # fmt: skip
    rows = [json.loads(line) for line in found.stderr.splitlines()]
    assert [(row["level"], row["name"], row["text"]) for row in rows] == [
        ("WARN", "quoting", 'a "b"\\\n c'), ("INFO", "quoting", "plain")
    ]  # fmt: skip
