"""The C++ example compiles: against rclcpp where it is installed, and always against the generated messages.

The wheels have no rclcpp.  Without it the calls of rclcpp are checked against declarations of the test's
own, so what is proved there is the C++ and every message field, not that rclcpp has these calls.
"""

import shutil
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_packages_with_prefixes

EXAMPLE = Path(__file__).parents[2] / "examples" / "fly_a_pass.cpp"
RCLCPP = r"""
#pragma once
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
namespace rclcpp
{
struct InitOptions {};
enum class SignalHandlerOptions {None};
enum class FutureReturnCode {SUCCESS, INTERRUPTED, TIMEOUT};
void init(int, char const * const *, const InitOptions &, SignalHandlerOptions);
bool shutdown();
struct Node
{
  using SharedPtr = std::shared_ptr<Node>;
  Node(const std::string &, const std::string &);
};
template<typename N, typename R, typename Rep = int64_t, typename Period = std::milli>
FutureReturnCode spin_until_future_complete(
  std::shared_ptr<N>, const std::shared_future<R> &,
  std::chrono::duration<Rep, Period> = std::chrono::duration<Rep, Period>(-1));
}
"""
RCLCPP_ACTION = r"""
#pragma once
#include "rclcpp/rclcpp.hpp"
namespace rclcpp_action
{
template<typename A>
struct ClientGoalHandle
{
  using SharedPtr = std::shared_ptr<ClientGoalHandle<A>>;
  struct WrappedResult {typename A::Result::SharedPtr result;};
};
template<typename A>
struct Client
{
  using Handle = ClientGoalHandle<A>;
  using SharedPtr = std::shared_ptr<Client<A>>;
  struct SendGoalOptions
  {
    std::function<void(typename Handle::SharedPtr, const std::shared_ptr<const typename A::Feedback>)> feedback_callback;
  };
  template<typename Rep, typename Period>
  bool wait_for_action_server(std::chrono::duration<Rep, Period>);
  std::shared_future<typename Handle::SharedPtr> async_send_goal(const typename A::Goal &, const SendGoalOptions &);
  std::shared_future<typename Handle::WrappedResult> async_get_result(typename Handle::SharedPtr);
  void async_cancel_goal(typename Handle::SharedPtr);
};
template<typename A, typename N>
typename Client<A>::SharedPtr create_client(N, const std::string &);
}
"""


def compiled(source: Path, *includes: Path) -> "subprocess.CompletedProcess[str]":
    if not (compiler := shutil.which("g++")):
        pytest.skip("no g++")
    folders = [f"-I{folder}" for folder in includes]
    command = [compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *folders, str(source)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def installed_headers() -> list[Path]:
    """Return the include folders of the installed packages."""
    prefixes = {Path(each) for each in get_packages_with_prefixes().values()}
    folders = [folder for prefix in prefixes for folder in (prefix / "include").glob("*") if folder.is_dir()]
    return [*(prefix / "include" for prefix in prefixes), *folders]


def test_the_cpp_example_uses_the_generated_messages_as_they_are(tmp_path: Path) -> None:
    for name, text in (("rclcpp", RCLCPP), ("rclcpp_action", RCLCPP_ACTION)):
        header = tmp_path / name / f"{name}.hpp"
        header.parent.mkdir()
        header.write_text(text)
    done = compiled(EXAMPLE, tmp_path, *installed_headers())
    assert done.returncode == 0, done.stderr[:4000]
    wrong = tmp_path / "wrong.cpp"
    wrong.write_text(EXAMPLE.read_text().replace("goal.satellite", "goal.spacecraft"))
    assert "has no member named" in compiled(wrong, tmp_path, *installed_headers()).stderr


def test_the_cpp_example_compiles_against_rclcpp() -> None:
    try:
        get_package_prefix("rclcpp_action")
    except LookupError:
        pytest.skip("rclcpp_action is not installed: the wheels have none")
    done = compiled(EXAMPLE, *installed_headers())
    assert done.returncode == 0, done.stderr[:4000]
