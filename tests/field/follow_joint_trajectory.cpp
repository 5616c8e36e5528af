// An action server for FollowJointTrajectory that treats goals as joint_trajectory_controller does
// (RealtimeServerGoalHandle, a timer that sends what the control loop has decided), in front of a
// simulated arm with two joints that are slow.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "control_msgs/action/follow_joint_trajectory.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "realtime_tools/realtime_buffer.hpp"
#include "realtime_tools/realtime_server_goal_handle.hpp"

using namespace std::chrono_literals;
using Action = control_msgs::action::FollowJointTrajectory;
using Result = Action::Result;
using Handle = std::shared_ptr<rclcpp_action::ServerGoalHandle<Action>>;
using RealtimeHandle = realtime_tools::RealtimeServerGoalHandle<Action>;
using RealtimePtr = std::shared_ptr<RealtimeHandle>;
using Positions = std::vector<double>;

namespace
{
const std::vector<std::string> JOINTS{"shoulder", "elbow"};
constexpr double FASTEST = 1.0;  // radians in a second
constexpr auto PERIOD = 10ms;

void say(const std::string & line)
{
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

double seconds_of(const builtin_interfaces::msg::Duration & duration)
{
  return duration.sec + 1e-9 * duration.nanosec;
}

std::shared_ptr<Result> result_of(int code, const std::string & text)
{
  auto result = std::make_shared<Result>();
  result->error_code = code;
  result->error_string = text;
  return result;
}

// A goal, from where the arm was when it began.
struct Motion
{
  Action::Goal goal;
  Positions from;
  std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();

  double passed() const
  {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  }

  double ends() const {return seconds_of(goal.trajectory.points.back().time_from_start);}

  // Return where the joints should be now, in the order of JOINTS.
  Positions desired() const
  {
    Positions before = from;
    double then = 0.0, now = passed();
    for (const auto & point : goal.trajectory.points) {
      double until = seconds_of(point.time_from_start);
      double part = until > then ? std::clamp((now - then) / (until - then), 0.0, 1.0) : 1.0;
      Positions at = before;
      for (size_t i = 0; i < at.size(); ++i) {
        at[column(i)] += part * (point.positions[i] - before[column(i)]);
      }
      before = at;
      then = until;
    }
    return before;
  }

  // Return the joint with an error that is too large, or nothing.
  std::string violates(
    const std::vector<control_msgs::msg::JointTolerance> & tolerances,
    const Positions & errors) const
  {
    for (size_t i = 0; i < JOINTS.size(); ++i) {
      for (const auto & tolerance : tolerances) {
        double allowed = tolerance.position;  // the controller's default is 0, too: not checked
        if (tolerance.name == JOINTS[i] && allowed > 0.0 && std::abs(errors[i]) > allowed) {
          return JOINTS[i];
        }
      }
    }
    return "";
  }

private:
  size_t column(size_t given) const
  {
    auto found = std::find(JOINTS.begin(), JOINTS.end(), goal.trajectory.joint_names[given]);
    return found - JOINTS.begin();
  }
};

class Controller
{
public:
  Controller(const char * action, double monitor_period)
  : monitor_period_(monitor_period), node_(std::make_shared<rclcpp::Node>("controller"))
  {
    server_ = rclcpp_action::create_server<Action>(
      node_, action,
      [this](const auto &, std::shared_ptr<const Action::Goal> goal) {return received(*goal);},
      [this](Handle goal) {return cancelled(goal);},
      [this](Handle goal) {accepted(goal);});
    loop_ = std::thread(
      [this] {
        while (running_) {
          std::this_thread::sleep_for(PERIOD);
          update();
        }
      });
    spinning_ = std::thread([this] {rclcpp::spin(node_);});
  }

  void stop()
  {
    running_ = false;
    loop_.join();
    rclcpp::shutdown();
    spinning_.join();
  }

private:
  rclcpp_action::GoalResponse received(const Action::Goal & goal)
  {
    auto names = goal.trajectory.joint_names;
    bool valid = !goal.trajectory.points.empty() &&
      std::is_permutation(names.begin(), names.end(), JOINTS.begin(), JOINTS.end());
    double before = -1.0;
    for (const auto & point : goal.trajectory.points) {
      double at = seconds_of(point.time_from_start);
      valid = valid && point.positions.size() == names.size() && at > before;
      before = at;
    }
    if (!valid) {
      say("rejected");
      return rclcpp_action::GoalResponse::REJECT;
    }
    return rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
  }

  void accepted(Handle goal)
  {
    if (auto active = *active_.readFromNonRT()) {
      active->setAborted(
        result_of(Result::INVALID_GOAL, "Current goal cancelled due to new incoming action."));
      active->runNonRealtime();
      active_.writeFromNonRT(RealtimePtr());
      say("preempted");
    }
    auto motion = std::make_shared<Motion>();
    motion->goal = *goal->get_goal();
    motion->from = *actual_.readFromNonRT();
    motion_.writeFromNonRT(motion);
    auto realtime = std::make_shared<RealtimeHandle>(goal);
    realtime->execute();
    active_.writeFromNonRT(realtime);
    say("executing");
    timer_ = node_->create_wall_timer(
      std::chrono::duration<double>(monitor_period_), [realtime] {realtime->runNonRealtime();});
  }

  rclcpp_action::CancelResponse cancelled(Handle goal)
  {
    auto active = *active_.readFromNonRT();
    bool is_active = active && active->gh_ == goal;
    say(is_active ? "cancel requested: active" : "cancel requested: not active");
    if (is_active) {
      motion_.writeFromNonRT(nullptr);  // the arm stays where it is
      active->setCanceled(std::make_shared<Result>());
      active_.writeFromNonRT(RealtimePtr());
    }
    return rclcpp_action::CancelResponse::ACCEPT;
  }

  // What the control loop does in each cycle.
  void update()
  {
    auto motion = *motion_.readFromRT();
    auto active = *active_.readFromRT();
    auto at = std::chrono::steady_clock::now();
    double step = FASTEST * std::chrono::duration<double>(at - updated_).count();
    updated_ = at;
    if (!motion) {
      return;
    }
    double now = motion->passed();
    Positions desired = motion->desired(), errors(JOINTS.size());
    for (size_t i = 0; i < JOINTS.size(); ++i) {
      arm_[i] += std::clamp(desired[i] - arm_[i], -step, step);
      errors[i] = desired[i] - arm_[i];
    }
    actual_.writeFromNonRT(arm_);
    if (!active) {
      return;
    }
    auto feedback = std::make_shared<Action::Feedback>();
    feedback->header.stamp = node_->now();
    feedback->joint_names = JOINTS;
    feedback->desired.positions = desired;
    feedback->actual.positions = arm_;
    feedback->error.positions = errors;
    active->setFeedback(feedback);

    double allowed = seconds_of(motion->goal.goal_time_tolerance);
    auto late = motion->violates(motion->goal.path_tolerance, errors);
    if (now < motion->ends()) {
      if (!late.empty()) {
        active->setAborted(
          result_of(
            Result::PATH_TOLERANCE_VIOLATED, "Aborted due to path tolerance violation: " + late));
        ended("aborted: path");
      }
    } else if (motion->violates(motion->goal.goal_tolerance, errors).empty()) {
      active->setSucceeded(result_of(Result::SUCCESSFUL, "Goal successfully reached!"));
      ended("succeeded");
    } else if (allowed > 0.0 && now > motion->ends() + allowed) {
      active->setAborted(
        result_of(Result::GOAL_TOLERANCE_VIOLATED, "Aborted due to goal_time_tolerance"));
      ended("aborted: goal");
    }
  }

  void ended(const std::string & how)
  {
    if (how != "succeeded") {
      motion_.writeFromNonRT(nullptr);
    }
    active_.writeFromNonRT(RealtimePtr());
    say(how);
  }

  const double monitor_period_;
  std::atomic<bool> running_{true};
  Positions arm_ = Positions(JOINTS.size(), 0.0);
  std::chrono::steady_clock::time_point updated_ = std::chrono::steady_clock::now();
  realtime_tools::RealtimeBuffer<Positions> actual_{arm_};
  realtime_tools::RealtimeBuffer<std::shared_ptr<Motion>> motion_;
  realtime_tools::RealtimeBuffer<RealtimePtr> active_;
  rclcpp::Node::SharedPtr node_;
  rclcpp_action::Server<Action>::SharedPtr server_;
  rclcpp::TimerBase::SharedPtr timer_;
  std::thread loop_, spinning_;
};
}  // namespace

extern "C" {
void * start(const char * action, double monitor_period)
{
  rclcpp::init(0, nullptr, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  return new Controller(action, monitor_period);
}
void stop(void * controller) {static_cast<Controller *>(controller)->stop();}
}
