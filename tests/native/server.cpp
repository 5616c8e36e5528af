// The reference server in C++: an rclcpp action server of Fibonacci, as robots have them.
//
// A Python process (serve.py) loads it as a library, because the libraries of ROS 2 from PyPI need
// the symbols of Python. Its behaviours have the names, options and events of actionkit.servers.

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <rclcpp/rclcpp.hpp>
#include <rclcpp_action/rclcpp_action.hpp>
#include <test_msgs/action/fibonacci.hpp>

using namespace std::chrono_literals;
using Fibonacci = test_msgs::action::Fibonacci;
using ActionServer = rclcpp_action::Server<Fibonacci>;
using Handle = rclcpp_action::ServerGoalHandle<Fibonacci>;
using Goal = std::shared_ptr<Handle>;
using Numbers = std::vector<int32_t>;

constexpr auto LOOK = 1ms;  // between two looks whether a goal is being cancelled
constexpr double FOREVER = 1e9;  // seconds
thread_local std::string this_goal;  // the id

extern "C" struct Options
{
  const char * kind;
  const char * point;
  double period, delay, result_timeout;
  int max_order, gate, feedback, write_feedback, journal;
};

struct Stopped {};   // the goal is being cancelled, or another one preempts it
struct Ending {};    // the process ends

class Journal
{
public:
  explicit Journal(int descriptor)
  : descriptor_(descriptor) {}

  void emit(const std::string & event, const std::string & goal_id, const std::string & more = "")
  {
    auto now = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch());
    std::ostringstream line;
    line.precision(9);
    line << std::fixed << "{\"event\": \"" << event << "\", \"goal_id\": ";
    line << (goal_id.empty() ? "null" : "\"" + goal_id + "\"");
    line << ", \"monotonic\": " << now.count() << more << "}\n";
    auto text = line.str();
    std::lock_guard<std::recursive_mutex> guard(lock);
    for (size_t done = 0; done < text.size(); ) {
      auto written = ::write(descriptor_, text.data() + done, text.size() - done);
      if (written < 0) {
        return;  // nobody reads any more
      }
      done += written;
    }
  }

  std::recursive_mutex lock;

private:
  int descriptor_;
};

class ReferenceServer
{
public:
  ReferenceServer(const char * node_name, const char * action, const Options & options)
  : option_(options), kind_(options.kind), point_(options.point), journal_(options.journal)
  {
    rclcpp::InitOptions init;
    init.auto_initialize_logging(false);
    rclcpp::init(0, nullptr, init, rclcpp::SignalHandlerOptions::None);
    node_ = std::make_shared<rclcpp::Node>(node_name);
    group_ = node_->create_callback_group(rclcpp::CallbackGroupType::Reentrant);
    auto settings = rcl_action_server_get_default_options();
    settings.result_timeout.nanoseconds = static_cast<int64_t>(options.result_timeout * 1e9);
    server_ = rclcpp_action::create_server<Fibonacci>(
      node_, action,
      [this](const auto & id, auto goal) {return decide(rclcpp_action::to_string(id), goal->order);},
      [this](auto goal) {return may_cancel(goal);},
      [this](auto goal) {accepted(goal);},
      settings, group_);
    if (kind_ == "slow_accept" || kind_ == "silent") {
      executor_ = std::make_unique<rclcpp::executors::MultiThreadedExecutor>(
        rclcpp::ExecutorOptions(), 8);
    } else {
      executor_ = std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
    }
    executor_->add_node(node_);
    thread_ = std::thread([this] {executor_->spin();});
  }

  // Leave the graph as a program does that ends in order; the goals are not ended.
  void stop()
  {
    change([this] {stopping_ = true;});
    executor_->cancel();
    thread_.join();
    executor_.reset();
    server_.reset();
    group_.reset();
    node_.reset();
    rclcpp::shutdown();
  }

  void release(int count)
  {
    change(
      [&] {
        open_ = count < 0;
        tickets_ = open_ ? 0 : tickets_ + count;
      });
    journal_.emit("released", "");
  }

  void hold()
  {
    change(
      [this] {
        open_ = false;
        tickets_ = 0;
      });
    journal_.emit("held", "");
  }

  void synced(int number)
  {
    journal_.emit("synced", "", ", \"n\": " + std::to_string(number));
  }

private:
  template<typename Change>
  void change(Change what, bool wake = true)
  {
    std::lock_guard<std::recursive_mutex> guard(lock_);
    what();
    if (wake) {
      changed_.notify_all();
    }
  }

  rclcpp_action::GoalResponse decide(const std::string & id, int order)
  {
    journal_.emit("goal_received", id, ", \"order\": " + std::to_string(order));
    crash_at("before_accept", id);
    try {
      if (kind_ == "silent") {
        sleep(FOREVER, [] {return false;});
      } else if (kind_ == "slow_accept") {
        auto never = [] {return false;};
        option_.gate ? wait_gate(never) : sleep(option_.delay, never);
      }
    } catch (const Ending &) {
      return rclcpp_action::GoalResponse::REJECT;
    }
    if (order < 0 || order > option_.max_order) {
      journal_.emit("rejected", id);
      return rclcpp_action::GoalResponse::REJECT;
    }
    return kind_ == "queued" ? rclcpp_action::GoalResponse::ACCEPT_AND_DEFER :
           rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
  }

  rclcpp_action::CancelResponse may_cancel(const Goal & goal)
  {
    auto id = rclcpp_action::to_string(goal->get_goal_id());
    journal_.emit("cancel_requested", id, ", \"running\": true");
    if (kind_ == "refuses_cancel") {
      journal_.emit("cancel_refused", id);
      return rclcpp_action::CancelResponse::REJECT;
    }
    journal_.emit("cancel_accepted", id);
    change([&] {canceling_.insert(id);});
    return rclcpp_action::CancelResponse::ACCEPT;
  }

  void accepted(const Goal & goal)
  {
    auto id = rclcpp_action::to_string(goal->get_goal_id());
    auto order = std::to_string(goal->get_goal()->order);
    journal_.emit("accepted", id, ", \"order\": " + order);
    crash_at("after_accept", id);
    if (kind_ == "blocking") {
      run(goal);
      return;
    }
    change([&] {turns_.push_back(id);}, kind_ == "preemptive");
    std::thread(
      [this, goal = Goal(goal)] {
        run(goal);
        if (stopping_ && goal->is_active()) {
          ::pause();  // a handle that is dropped ends its goal as CANCELED
        }
      }).detach();
  }

  void run(const Goal & goal)
  {
    auto id = this_goal = rclcpp_action::to_string(goal->get_goal_id());
    Numbers content;
    auto must_stop = [&] {return goal->is_canceling() || is_preempted(id);};
    try {
      try {
        if (kind_ == "queued" || kind_ == "preemptive") {
          sleep(FOREVER, [&] {return goal->is_canceling() || is_first(id);});
        }
        if (kind_ == "queued" && !goal->is_canceling()) {
          goal->execute();
        }
        journal_.emit("executing", id);
        work(goal, id, content, must_stop);
      } catch (const Stopped &) {
        end(goal, id, goal->is_canceling() ? "canceled" : "aborted", content);
      }
    } catch (const Ending &) {
    } catch (const std::exception & error) {
      journal_.emit("error", id, std::string(", \"message\": \"") + error.what() + "\"");
    }
    bool others_wait = kind_ == "queued" || kind_ == "preemptive";
    change(
      [&] {turns_.erase(std::remove(turns_.begin(), turns_.end(), id), turns_.end());},
      others_wait);
  }

  template<typename Check>
  void work(const Goal & goal, const std::string & id, Numbers & content, Check must_stop)
  {
    auto never = [] {return false;};
    auto order = goal->get_goal()->order;
    if (kind_ == "never_finishes") {
      publish(goal, id, content = {0}, 1);
      sleep(FOREVER, must_stop);
      throw Stopped();
    } else if (kind_ == "slow_cancel") {
      publish(goal, id, content = {0}, 1);
      sleep(FOREVER, [&] {return goal->is_canceling();});
      option_.gate ? wait_gate(never) : sleep(option_.delay, never);
      throw Stopped();
    } else if (kind_ == "blocking") {
      option_.gate ? wait_gate(never) : sleep(option_.delay, never);
      end(goal, id, "succeeded", {0, 1});
    } else if (kind_ == "cancels_itself") {
      publish(goal, id, content = {0}, 1);
      journal_.emit("canceled", id);  // by dropping the handle
    } else if (kind_ == "countdown" || kind_ == "ignores_cancel" || kind_ == "refuses_cancel") {
      bool heeds = kind_ == "countdown";
      for (int left = order; left >= 0; --left) {
        content.clear();
        for (int number = left; number >= 0; --number) {
          content.push_back(number);
        }
        if (left < order) {
          publish(goal, id, content, order - left);
        }
        if (left > 0) {
          sleep(option_.period, [&] {return heeds && must_stop();});
        } else if (option_.gate) {
          wait_gate([&] {return heeds && must_stop();});
        }
        if (heeds && must_stop()) {
          throw Stopped();
        }
      }
      end(goal, id, "succeeded", content);
    } else {
      if (kind_ == "crashes" && point_ == "feedback") {
        publish(goal, id, {0, 1}, 1);
        crash_at("feedback", id);
      }
      bool aborts = kind_ == "aborts";
      content = {0, 1};
      for (int step = 1; step < order + aborts; ++step) {
        int64_t next = static_cast<int64_t>(content[step]) + content[step - 1];
        content.push_back(static_cast<int32_t>(next % (int64_t{1} << 31)));
        sleep(option_.period, must_stop);
        if (must_stop()) {
          throw Stopped();
        }
        if (option_.feedback) {
          publish(goal, id, content, step);
        }
      }
      if (option_.gate && kind_ != "slow_accept") {
        wait_gate(must_stop);
      }
      if (must_stop()) {
        throw Stopped();
      }
      crash_at("before_result", id);
      end(goal, id, aborts ? "aborted" : "succeeded", content);
    }
  }

  void publish(const Goal & goal, const std::string & id, const Numbers & content, int number)
  {
    auto feedback = std::make_shared<Fibonacci::Feedback>();
    feedback->sequence = content;
    goal->publish_feedback(feedback);
    if (option_.write_feedback) {
      journal_.emit("feedback", id, ", \"n\": " + std::to_string(number));
    }
  }

  void end(
    const Goal & goal, const std::string & id, const std::string & how, const Numbers & content)
  {
    auto result = std::make_shared<Fibonacci::Result>();
    result->sequence = content;
    // Together: a client may send a new goal at once, and its events come after this one.
    std::lock_guard<std::recursive_mutex> guard(journal_.lock);
    if (how == "canceled") {
      goal->canceled(result);
    } else if (how == "aborted") {
      goal->abort(result);
    } else {
      goal->succeed(result);
    }
    journal_.emit(how, id);
  }

  void crash_at(const char * point, const std::string & id)
  {
    if (kind_ == "crashes" && point_ == point) {
      journal_.emit("crashing", id, ", \"point\": \"" + point_ + "\"");
      ::kill(::getpid(), SIGKILL);
    }
  }

  // Wait until something is so, or for a time. Many goals wait at once, so they do not look often.
  template<typename Check>
  void sleep(double seconds, Check enough)
  {
    auto until = std::chrono::steady_clock::now() +
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds));
    std::unique_lock<std::recursive_mutex> guard(lock_);
    while (!enough() && std::chrono::steady_clock::now() < until) {
      if (stopping_) {
        throw Ending();
      }
      // A goal is being cancelled a moment after `may_cancel`, and nobody is told of that.
      auto look = canceling_.count(this_goal) ? std::chrono::steady_clock::now() + LOOK : until;
      changed_.wait_until(guard, std::min(look, until));
    }
  }

  template<typename Check>
  void wait_gate(Check enough)
  {
    int number;
    {
      std::lock_guard<std::recursive_mutex> guard(lock_);
      number = arrivals_++;
      waiting_.insert(number);
    }
    bool passed = false;
    sleep(
      FOREVER, [&] {
        if (!passed && (open_ || (tickets_ > 0 && *waiting_.begin() == number))) {
          tickets_ -= !open_;
          passed = true;
        }
        return passed || enough();
      });
    std::lock_guard<std::recursive_mutex> guard(lock_);
    waiting_.erase(number);
    if (tickets_ > 0) {
      changed_.notify_all();  // the next one may pass
    }
  }

  bool is_first(const std::string & id)
  {
    std::lock_guard<std::recursive_mutex> guard(lock_);
    return turns_.front() == id;
  }

  bool is_preempted(const std::string & id)
  {
    std::lock_guard<std::recursive_mutex> guard(lock_);
    return kind_ == "preemptive" && turns_.back() != id;
  }

  const Options option_;
  const std::string kind_, point_;
  Journal journal_;
  std::atomic<bool> stopping_{false};
  std::recursive_mutex lock_;  // for all of these
  std::condition_variable_any changed_;
  bool open_ = false;
  int tickets_ = 0;
  int arrivals_ = 0;
  std::set<int> waiting_;
  std::set<std::string> canceling_;
  std::deque<std::string> turns_;  // the goals that have not ended, oldest first
  rclcpp::Node::SharedPtr node_;
  rclcpp::CallbackGroup::SharedPtr group_;
  ActionServer::SharedPtr server_;
  std::unique_ptr<rclcpp::Executor> executor_;
  std::thread thread_;
};

extern "C" {
void * start(const char * node_name, const char * action, const Options * options)
{
  return new ReferenceServer(node_name, action, *options);
}
void stop(ReferenceServer * server) {server->stop();}
void release(ReferenceServer * server, int count) {server->release(count);}
void hold(ReferenceServer * server) {server->hold();}
void synced(ReferenceServer * server, int number) {server->synced(number);}
}
