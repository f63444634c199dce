// Flies one pass with rclcpp_action, as a program of yours would: goal by name, feedback, errors, stop.
//
//   fly_a_pass /gs1 28057        Ctrl-C stops the antenna under control
//
// CMake: find_package(rclcpp rclcpp_action rf_pointing_msgs), ament_target_dependencies(fly_a_pass ...).

#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "rf_pointing_msgs/action/track_pass.hpp"

using TrackPass = rf_pointing_msgs::action::TrackPass;
using Handle = rclcpp_action::ClientGoalHandle<TrackPass>;

namespace
{
volatile std::sig_atomic_t interrupted = 0;

void show(Handle::SharedPtr, const std::shared_ptr<const TrackPass::Feedback> feedback)
{
  const auto & status = feedback->status;
  std::printf(
    "%4.0f%% %-13s %s %s\n", 100.0 * feedback->progress, status.mode.c_str(), status.held ? "held" : "",
    status.alarm.c_str());
}

// Whatever went wrong is a sentence; `fault` is what must be mended before the next pass.
int report(const TrackPass::Result & result)
{
  std::printf(
    "%s: %s; %.0f s held\n", result.target_pass.target.c_str(), result.message.c_str(), result.seconds_tracked);
  if (!result.fault.empty()) {
    std::fprintf(stderr, "fault: %s\n", result.fault.c_str());
  }
  return result.success ? 0 : 1;
}

int fly(const std::string & name_space, const std::string & satellite)
{
  using namespace std::chrono_literals;
  auto node = std::make_shared<rclcpp::Node>("fly_a_pass", name_space);
  auto client = rclcpp_action::create_client<TrackPass>(node, "track_pass");
  if (!client->wait_for_action_server(10s)) {
    std::fprintf(stderr, "no pointing_controller in %s\n", name_space.c_str());
    return 2;
  }
  TrackPass::Goal goal;
  goal.satellite = satellite;
  rclcpp_action::Client<TrackPass>::SendGoalOptions options;
  options.feedback_callback = show;
  auto sent = client->async_send_goal(goal, options);
  if (rclcpp::spin_until_future_complete(node, sent) != rclcpp::FutureReturnCode::SUCCESS) {
    return 2;
  }
  Handle::SharedPtr handle = sent.get();
  if (!handle) {
    std::fprintf(stderr, "rejected: another pass is tracked, or the controller is not active\n");
    return 2;
  }
  auto ended = client->async_get_result(handle);
  bool cancelled = false;
  // The result of a cancelled goal arrives when the antenna has come to rest.
  while (rclcpp::spin_until_future_complete(node, ended, 200ms) == rclcpp::FutureReturnCode::TIMEOUT) {
    if (interrupted && !cancelled) {
      client->async_cancel_goal(handle);
      cancelled = true;
    }
  }
  return report(*ended.get().result);
}
}  // namespace

int main(int argc, char ** argv)
{
  // Ctrl-C must cancel the goal, not end rclcpp under it.
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  std::signal(SIGINT, [](int) {interrupted = 1;});
  const int code = fly(argc > 2 ? argv[1] : "/gs1", argc > 2 ? argv[2] : "28057");
  rclcpp::shutdown();
  return code;
}
