# Sourced by the other scripts: makes whatever is missing, then enters the environment.  Idempotent.
#
# Two ways in.  With a ROS 2 Jazzy install sourced (ROS_DISTRO=jazzy and colcon on the path) its Python, its colcon and
# its interfaces are used, and only Python libraries without a Debian package are added beside it.  Otherwise a
# virtual environment is built from pinned wheels.  Everything made lives in .ros/ below the checkout.

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
STATE=$ROOT/.ros
LOG=$STATE/setup.log

say() { echo "rf_pointing: $*" >&2; }
die() { say "$*"; exit 1; }

has_jazzy() { [ "${ROS_DISTRO:-}" = jazzy ] && [ -z "${RF_POINTING_WHEELS:-}" ] && command -v colcon >/dev/null; }

# need COMMAND-THAT-PROVES-IT DEBIAN-PACKAGE...: install the packages when root, else name them.
need() {
  local proof=$1
  shift
  eval "$proof" >/dev/null 2>&1 && return
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || die "missing $*: install with 'sudo apt-get install $*'"
  say "installing $*"
  { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"; } >>"$LOG" 2>&1 ||
    die "could not install $*; see $LOG"
}

digest() { cat "$@" | sha256sum | cut -d' ' -f1; }

# made STAMP DIGEST: whether a command already succeeded for this digest.
made() { [ -f "$STATE/$1" ] && [ "$(cat "$STATE/$1")" = "$2" ]; }

# once STAMP DIGEST MESSAGE COMMAND...: run the command unless it already succeeded for this digest.
once() {
  made "$1" "$2" && return
  local stamp=$STATE/$1 want=$2 message=$3 began=$SECONDS reporter='' status=0
  shift 3
  say "$message"
  # Without job control a command in the background would not hear Ctrl-C: the report is there, the work is here.
  if [ -t 2 ]; then report_progress & reporter=$!; fi
  "$@" >>"$LOG" 2>&1 || status=$?
  [ -z "$reporter" ] || { kill "$reporter"; wait "$reporter" || true; printf '\r\033[K' >&2; } 2>/dev/null
  [ $status = 0 ] || { tail -n 15 "$LOG" >&2; die "set-up step '$*' failed; the whole log is $LOG"; }
  say "done in $((SECONDS - began)) s"
  echo "$want" >"$stamp"
}

# The seconds and the last line of the log, each second, until it is ended.
report_progress() {
  local began=$SECONDS
  while sleep 1; do
    printf '\r\033[K  %s s: %.70s' $((SECONDS - began)) "$(tail -n 1 "$LOG" | tr -dc '[:print:]')" >&2
  done
}

# install_wheels LIST...: the pinned wheels of these lists of requirements/.  Python compiles what is imported, not all.
install_wheels() {
  local lists=() name
  for name in "$@"; do lists+=(-r "$ROOT/requirements/$name.txt"); done
  "$STATE/env/bin/python" -m pip install --disable-pip-version-check --no-input --no-compile --no-cache-dir \
    "${lists[@]}" -c "$ROOT/requirements/lock.txt"
}

make_wheel_environment() {
  python3 -m venv --clear "$STATE/env" && install_wheels ros numeric runtime && mend_cmake_exports && shrink_environment
}

# The wheels of ROS bring the same libraries up to eight times, and a link as a copy: 60 MB.  Others bring their tests: 30 MB,
# and symbols for debuggers: 33 MB.
shrink_environment() {
  local sum file before='' first=''
  ! command -v strip ||
    find "$STATE"/env/lib/python3.*/site-packages/{aiohttp,erfa,fontTools,frozenlist,kiwisolver,lz4,multidict,propcache,yaml} \
      -name '*.so' -exec strip --strip-debug {} +
  find "$STATE"/env/lib/python3.*/site-packages/{numpy,scipy,matplotlib} -depth -type d -name tests -exec rm -r {} +
  find "$STATE/env/lib" -type f -name '*.so*' -size +100k -exec sha256sum {} + | sort | while read -r sum file; do
    if [ "$sum" = "$before" ]; then ln -f "$first" "$file"; else before=$sum first=$file; fi
  done
}

# Never under running nodes: what they import later would be of another version, or gone.
with_nothing_running() {
  flock -n -x 8 || { echo "part of $STATE must be made anew, and processes run from it: end them first"; return 1; }
  # An end half-way leaves neither the old nor the new.
  rm -f "$stamp"
  "$@" && flock -s 8
}

# The Python that the environment was made with decides, not the one that is first on PATH now.
environment_python() { "$STATE/env/bin/python" --version 2>/dev/null || python3 --version; }

# The wheels' exported CMake targets name the header folders of the machine that built them.
mend_cmake_exports() {
  local python_h numpy_h
  python_h=$("$STATE/env/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  numpy_h=$("$STATE/env/bin/python" -c 'import numpy; print(numpy.get_include())')
  grep -rlZ --include='*.cmake' /opt/python/cp "$STATE/env" | xargs -0 -r sed -i -E \
    -e "s#/opt/python/cp[^;\"]*/numpy/_core/include#$numpy_h#g" \
    -e "s#/opt/python/cp[^;\"]*/include/python[0-9.]+#$python_h#g"
}

add_python_libraries() {
  local lists=() name
  for name in "$@"; do lists+=(-r "$ROOT/requirements/$name.txt"); done
  python3 -m pip install --disable-pip-version-check --no-input --upgrade --target "$STATE/python" --no-deps "${lists[@]}"
}

# What scripts/check, scripts/test and benchmarks/ need beside it.
add_test_libraries() {
  local r=$ROOT/requirements
  if has_jazzy; then
    once test-libraries "$(digest "$r"/{test,beside-jazzy}.txt)" "adding the libraries of the tests" add_python_libraries test
  else
    once env/test-wheels "$(digest "$r"/{test,extras,lock}.txt)" "adding the wheels of the tests (500 MB, once)" \
      install_wheels test extras
  fi
}

# Whether ROS itself, as found so far, has a package; what was built here before does not count.
distributed() {
  local prefix
  for prefix in ${AMENT_PREFIX_PATH//:/ }; do
    [[ $prefix != "$STATE"/install* ]] && [ -d "$prefix/share/$1" ] && return
  done
  return 1
}

# colcon_build ARGUMENT...: without MAKEFLAGS colcon asks make to wait for an idle machine.
colcon_build() {
  cd "$ROOT" && MAKEFLAGS=-j$(nproc) colcon --log-base "$STATE/log" build \
    --build-base "$STATE/build" --install-base "$STATE/install" "$@" \
    --cmake-args "-DPython3_EXECUTABLE=$(command -v python3)" -DBUILD_TESTING=OFF
}

# What was generated and compiled on the way is 60 MB and not used again.
build_interfaces() {
  local packages=(msg_defs) folders
  distributed tf2_msgs || packages+=(extern/tf2_msgs)
  folders=("$STATE"/{build,install}/{rf_pointing_msgs,tf2_msgs})
  rm -rf "${folders[@]}"
  colcon_build --base-paths "${packages[@]}" && rm -rf "${folders[@]:0:2}"
}

# Links to files that are gone since the last build would fail it; the Python package is made anew in seconds.
build_workspace() {
  rm -rf "$STATE/build/rf_pointing" "$STATE/install/rf_pointing"
  AMENT_PREFIX_PATH=$STATE/install/rf_pointing_msgs:$AMENT_PREFIX_PATH colcon_build --base-paths . --symlink-install
}

enter_wheels_environment() {
  [ -x "$STATE/env/bin/python" ] ||
    need "python3 -c 'import ensurepip, venv, sys; assert (3, 11) <= sys.version_info < (3, 15)'" python3 python3-venv
  once wheels "$(digest "$ROOT"/requirements/{ros,numeric,runtime,lock}.txt <(environment_python))" \
    "building the Python environment from pinned wheels (420 MB, about a minute, once)" with_nothing_running make_wheel_environment
  export VIRTUAL_ENV=$STATE/env PATH=$STATE/env/bin:$PATH
  # Setting these here spares every process the bootstrap that would start Python a second time to set them.
  LD_LIBRARY_PATH=$(printf '%s:' "$STATE"/env/lib "$STATE"/env/lib/python3.*/site-packages/ros_*.libs)${LD_LIBRARY_PATH:-}
  export LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
  export AMENT_PREFIX_PATH=$STATE/env CMAKE_PREFIX_PATH=$STATE/env
}

enter_jazzy_environment() {
  need "python3 -m pip --version" python3-pip
  need "python3 -c 'import numpy, scipy, matplotlib, yaml, requests, aiohttp'" python3-numpy python3-scipy python3-matplotlib \
    python3-yaml python3-requests python3-aiohttp
  once python-libraries "$(digest "$ROOT"/requirements/{runtime,beside-jazzy}.txt)" \
    "adding the Python libraries that have no Debian package" add_python_libraries runtime beside-jazzy
  export PYTHONPATH=$STATE/python${PYTHONPATH:+:$PYTHONPATH}
}

# enter_environment [tests]
enter_environment() {
  mkdir -p "$STATE"
  # Containers and build machines often forbid compiled files beside the sources.  Then they are kept here: without
  # any, each process compiles numpy, scipy, ROS and this package anew, which is more than half of a node's start.
  if [ -n "${PYTHONDONTWRITEBYTECODE:-}" ]; then
    unset PYTHONDONTWRITEBYTECODE
    export PYTHONPYCACHEPREFIX=${PYTHONPYCACHEPREFIX:-$STATE/bytecode}
  fi
  exec 9>"$STATE/lock"
  flock 9
  # Every process started from here holds this lock while it runs, so that nobody replaces the environment under it.
  exec 8>"$STATE/in-use"
  flock -s 8
  local how=wheels interfaces sources
  ! has_jazzy || how=jazzy
  interfaces=$(find "$ROOT/msg_defs" "$ROOT/extern" -type f | sort)
  sources=$(find "$ROOT/config" "$ROOT/launch" -type f | sort)
  # shellcheck disable=SC2086
  interfaces="$how $(digest <(echo "$interfaces") $interfaces)"
  # What is built needs no compiler: a container has none.
  if [ $how = wheels ] && ! made interfaces "$interfaces"; then
    need "command -v g++ && command -v make && command -v cmake &&
      python3 -c 'import os, sysconfig; os.stat(sysconfig.get_path(\"include\") + \"/Python.h\")'" g++ make cmake python3-dev
  fi
  enter_${how}_environment
  [ "${1:-}" != tests ] || add_test_libraries
  once interfaces "$interfaces" "building the interfaces (a minute, once)" with_nothing_running build_interfaces
  once workspace "$how $(digest <(echo "$sources") "$ROOT"/setup.* "$ROOT/package.xml" "$STATE/interfaces")" \
    "building rf_pointing" build_workspace
  set +u
  # shellcheck disable=SC1091
  . "$STATE/install/local_setup.bash"
  set -u
  exec 9>&-
  if [ -z "${ROS_AUTOMATIC_DISCOVERY_RANGE:-}${FASTRTPS_DEFAULT_PROFILES_FILE:-}${ROS_DISCOVERY_SERVER:-}" ]; then
    export ROS_AUTOMATIC_DISCOVERY_RANGE=SYSTEM_DEFAULT FASTRTPS_DEFAULT_PROFILES_FILE=$ROOT/config/fastdds_loopback.xml
  fi
}
