"""Executable `launch`: start the processes of a launch file, and keep them running.

    launch single_antenna station:=my_dish.yaml executive:=true page:=true rotctld:=true
    launch single_antenna station:=my_dish.yaml page:=true --detach
    launch status        launch stop        launch single_antenna --show-args

Arguments are those of `ros2 launch rf_pointing NAME.launch.py`, which this replaces where ROS has
no such tool.  A process that ends is started again (`respawn:=false`: not); Ctrl-C ends all of them
in order and stops the antenna.  Exit code 0: ended on request; 1: it cannot start, or a process
without respawn has failed; with `status`: something of it does not run.
"""

import argparse
import os
import shlex
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from rf_pointing.core.dates import utc_text
from rf_pointing.ros.launching import LaunchFile, Process, launch_files
from rf_pointing.ros.main_loop import InstanceLock, present_holder
from rf_pointing.ros.supervisor import Supervisor, lock_name, log_folder, running, to_terminal
from rf_pointing.station.description.reading import nearest
from rf_pointing.station.log_lines import say

PROGRAM = "launch"
PATIENCE_S = 60.0
"""Longest time in which all processes of a station end."""
ENDED_FOR_S = 0.1


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing launch` and of scripts/launch."""
    parser = argparse.ArgumentParser(
        allow_abbrev=False, prog=PROGRAM, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("name", metavar="NAME", help=f"{', '.join(launch_files())}; or `status`, or `stop`")
    add("words", nargs="*", metavar="ARGUMENT:=VALUE", help="as of `ros2 launch`; a namespace after status and stop")
    add("-s", "--show-args", action="store_true", help="print the arguments of NAME with their defaults")
    add("-p", "--print", action="store_true", help="print the command line of each process, and start none")
    add("--detach", action="store_true", help="go on in the background, without a terminal")
    given = parser.parse_intermixed_args(argv)
    try:
        if given.name in ("status", "stop"):
            sys.exit(ended(given.words) if given.name == "stop" else status(given.words))
        file = launch_file(given.name)
        if given.show_args:
            print("\n".join(shown_arguments(file)))
            return
        values = file.values(pairs(given.words))
        processes = file.processes(values)
        if given.print:
            folder = Path(mkdtemp(prefix="rf_pointing-"))
            for process in processes:
                environment = (f"{name}={value}" for name, value in process.environment.items())
                print(shlex.join(["env", *environment, *process.command(folder)]))
            return
        sys.exit(start(file, values["namespace"], given.words, processes, detach=given.detach))
    except (ValueError, RuntimeError, OSError) as error:
        say(PROGRAM, str(error))
        sys.exit(1)


def launch_file(name: str) -> LaunchFile:
    """Return the launch file of a name, with or without its ending; ValueError for another one."""
    known, short = launch_files(), name.removesuffix(".py").removesuffix(".launch")
    if short not in known:
        raise ValueError(f"there is no launch file {name!r}{nearest(short, (*known, 'status', 'stop'))}")
    return known[short]()


def pairs(words: list[str]) -> dict[str, str]:
    """Return names and values of `name:=value`; ValueError for another word."""
    for word in words:
        if not all(word.partition(":=")):
            raise ValueError(f"argument {word!r} must be written NAME:=VALUE (an empty value: leave it out)")
    return dict(word.split(":=", 1) for word in words)


def shown_arguments(file: LaunchFile) -> list[str]:
    """Return name, meaning, choices and default of every argument, as `ros2 launch` prints them."""
    lines = ["Arguments (pass arguments as '<name>:=<value>'):"]
    for argument in file.arguments:
        words = ("true", "false") if argument.words and argument.kind is bool else argument.words
        choices = f". Valid choices are: {', '.join(words)}" if words else ""
        default = "(must be given)" if argument.default is None else f"(default: '{argument.default}')"
        lines += ["", f"    '{argument.name}':", f"        {argument.description}{choices}", f"        {default}"]
    return lines


def start(file: LaunchFile, namespace: str, words: list[str], processes: list[Process], *, detach: bool) -> int:
    """Run the processes to their end, or to the first line of a background process of their own."""
    folder, lock = log_folder(namespace), InstanceLock(lock_name(namespace))
    if detach:
        folder.mkdir(parents=True, exist_ok=True)
        if os.fork():
            print(f"{namespace} goes on in the background; logs: {folder}", flush=True)
            os._exit(0)
        os.setsid()
        lock.take_over()
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (sys.stdin, sys.stdout, sys.stderr):
            os.dup2(null, stream.fileno())
    signals: list[int] = []
    for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(sign, lambda number, _frame: signals.append(number))
    about = {"file": file.name, "namespace": namespace, "process": os.getpid(), "began_t_s": time.time()}
    supervisor = Supervisor(processes, folder, about, None if detach else to_terminal)
    supervisor.say(f"{file.name} {shlex.join(words)}, process {os.getpid()}; logs: {folder}")
    code = supervisor.run(signals)
    lock.release()
    return code


def status(words: list[str]) -> int:
    """Print every process of what runs; return 0 when all of them run."""
    found = running(words)
    for state in found:
        print("\n".join(shown_state(state)))
    if not found:
        say(PROGRAM, f"nothing runs{f' in {words[0]}' if words else ''}")
    return 0 if found and all(each["process"] for state in found for each in state["processes"].values()) else 1


def shown_state(state: Mapping[str, Any]) -> list[str]:
    """Return the lines of one launch: when it began, what runs, what was started again."""
    lines = [
        f"/{state['namespace'].strip('/')}: {state['file']}, process {state['process']}, since {utc_text(state['began_t_s'])}"
    ]
    for name, each in state["processes"].items():
        runs = (
            f"process {each['process']}, {time.time() - each['started_t_s']:.0f} s"
            if each["process"]
            else "does not run"
        )
        again = f"; started {each['starts']} times, {each['last_end']}" if each["last_end"] else ""
        lines.append(f"  {name:<24}{runs}{again}")
    return [*lines, f"  logs: {state['folder']}"]


def ended(words: list[str]) -> int:
    """End what runs in a namespace, and wait for it; return 0 when it has ended."""
    found = running(words)
    names = ", ".join(state["namespace"] for state in found)
    if len(found) != 1:
        raise ValueError(f"say which one to stop: {names}" if found else "nothing runs")
    process = int(found[0]["process"])
    os.kill(process, signal.SIGINT)
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        if present_holder(lock_name(found[0]["namespace"])) != process:
            say(PROGRAM, f"{names} has ended")
            return 0
        time.sleep(ENDED_FOR_S)
    raise RuntimeError(f"{names} (process {process}) has not ended within {PATIENCE_S:g} s")
