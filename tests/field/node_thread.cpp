// nav2_util::NodeThread, which Nav2 has in a library of its own and the archive lacks.
#include "nav2_util/node_thread.hpp"

namespace nav2_util
{
NodeThread::NodeThread(rclcpp::executors::SingleThreadedExecutor::SharedPtr executor)
: executor_(executor)
{
  thread_ = std::make_unique<std::thread>([this] {executor_->spin();});
}

NodeThread::~NodeThread()
{
  executor_->cancel();
  thread_->join();
}
}  // namespace nav2_util
