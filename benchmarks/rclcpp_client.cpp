// A client in C++, called from Python: the least that a call costs with ROS 2's own libraries.

#include <atomic>
#include <chrono>
#include <deque>
#include <future>
#include <memory>
#include <string>
#include <thread>

#include <rclcpp/rclcpp.hpp>
#include <rclcpp_action/rclcpp_action.hpp>
#include <test_msgs/action/fibonacci.hpp>

using Fibonacci = test_msgs::action::Fibonacci;
using Client = rclcpp_action::Client<Fibonacci>;

constexpr std::chrono::seconds PATIENCE{60};
constexpr size_t WINDOW = 8;

struct Caller
{
  std::shared_ptr<rclcpp::Node> node;
  std::shared_ptr<Client> client;
  std::unique_ptr<rclcpp::executors::SingleThreadedExecutor> executor;
  std::thread thread;
  std::atomic<int> feedback{0};
};

// Return a client of the action that is connected to a server, or null.
extern "C" void * open_client(const char * name)
{
  if (!rclcpp::ok()) {
    rclcpp::InitOptions options;
    options.auto_initialize_logging(false);
    rclcpp::init(0, nullptr, options, rclcpp::SignalHandlerOptions::None);
  }
  auto caller = std::make_unique<Caller>();
  caller->node = std::make_shared<rclcpp::Node>("rclcpp_client");
  auto options = rcl_action_client_get_default_options();
  options.goal_service_qos.depth = 2000;
  options.result_service_qos.depth = 2000;
  options.feedback_topic_qos.depth = 2000;
  caller->client = rclcpp_action::create_client<Fibonacci>(caller->node, name, nullptr, options);
  caller->executor = std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
  caller->executor->add_node(caller->node);
  caller->thread = std::thread([executor = caller->executor.get()] {executor->spin();});
  if (!caller->client->wait_for_action_server(PATIENCE)) {
    return nullptr;
  }
  // A server that is ready may not have discovered us yet, and its answers would be lost.
  for (int i = 0; i < 60; ++i) {
    auto answer = caller->client->async_cancel_goals_before(rclcpp::Time(1));
    if (answer.wait_for(std::chrono::seconds(1)) == std::future_status::ready) {
      return caller.release();
    }
  }
  return nullptr;
}

// Call once; return the length of the result's sequence, or -1.
extern "C" int call(Caller * caller, int order, bool with_feedback)
{
  Client::SendGoalOptions options;
  if (with_feedback) {
    options.feedback_callback = [caller](auto, auto) {++caller->feedback;};
  }
  Fibonacci::Goal goal;
  goal.order = order;
  auto accepted = caller->client->async_send_goal(goal, options);
  if (accepted.wait_for(PATIENCE) != std::future_status::ready) {
    return -1;
  }
  auto handle = accepted.get();
  if (!handle) {
    return -1;
  }
  auto ended = caller->client->async_get_result(handle);
  if (ended.wait_for(PATIENCE) != std::future_status::ready) {
    return -1;
  }
  auto result = ended.get();
  if (result.code != rclcpp_action::ResultCode::SUCCEEDED) {
    return -1;
  }
  return static_cast<int>(result.result->sequence.size());
}

// Have so many goals in flight at a time; write the seconds that each took. Return how many
// have succeeded, or -1.
extern "C" int at_once(Caller * caller, int goals, int order, double * took)
{
  using Clock = std::chrono::steady_clock;
  auto succeeded = std::make_shared<std::atomic<int>>(0);
  auto left = std::make_shared<std::atomic<int>>(goals);
  auto ended = std::make_shared<std::promise<void>>();
  std::deque<std::shared_future<rclcpp_action::ClientGoalHandle<Fibonacci>::SharedPtr>> sent;
  for (int i = 0; i < goals; ++i) {
    if (sent.size() == WINDOW) {
      if (sent.front().wait_for(PATIENCE) != std::future_status::ready) {
        return -1;
      }
      sent.pop_front();
    }
    Client::SendGoalOptions options;
    const auto began = Clock::now();
    options.result_callback = [=](const auto & result) {
        took[i] = std::chrono::duration<double>(Clock::now() - began).count();
        *succeeded += result.code == rclcpp_action::ResultCode::SUCCEEDED;
        if (--*left == 0) {
          ended->set_value();
        }
      };
    Fibonacci::Goal goal;
    goal.order = order;
    sent.push_back(caller->client->async_send_goal(goal, options));
  }
  const auto ready = ended->get_future().wait_for(PATIENCE);
  return ready == std::future_status::ready ? succeeded->load() : -1;
}

// Return how many feedback messages came since this was asked before.
extern "C" int feedback(Caller * caller)
{
  return caller->feedback.exchange(0);
}

extern "C" void close_client(Caller * caller)
{
  caller->executor->cancel();
  caller->thread.join();
  delete caller;
}
