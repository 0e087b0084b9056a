#include "stop_requests.hpp"

#include <chrono>
#include <optional>
#include <utility>

#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/messages.hpp"
#include "rtpm/ros2/names.hpp"

namespace rtpm::ros2 {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kStopSizeMax = 64;

}  // namespace

expected<std::unique_ptr<StopRequests>, SetupError> StopRequests::create(
    rpc::Node& node, Participant& participant, gvd::StopDeliveryConfig config, rt::Log& log) {
  std::unique_ptr<StopRequests> requests(new StopRequests(node, std::move(config), log));
  auto thread =
      rt::Thread::start({.name = "rtpm-ros2-stop"}, [its = requests.get()] { its->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  requests->thread_ = std::move(*thread);
  auto all = requests->subscribe(participant, "");
  if (!all) return unexpected{std::move(all.error())};
  requests->all_ = std::move(*all);
  return requests;
}

StopRequests::~StopRequests() {
  all_.clear();
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

expected<std::vector<std::unique_ptr<Subscription>>, SetupError> StopRequests::subscribe(
    Participant& participant, const std::string& device) {
  std::vector<std::unique_ptr<Subscription>> subscriptions;
  std::optional<SetupError> problem;
  const auto add = [&]<class M>(const M&, Reliability reliability) {
    if (problem) return;
    auto made = participant.subscribe({device.empty() ? "/rtpm/stop" : topic_name(device, "stop"),
                                       std::string(M::kType), type_hash<M>()},
                                      {.reliability = reliability}, kStopSizeMax,
                                      [this, device](const Received& message) {
                                        if constexpr (std::is_same_v<M, Bool>) {
                                          const auto flag = decode<Bool>(message.cdr);
                                          if (flag && !flag->data) return;
                                        }
                                        // A message that can't be read stops, too.
                                        request(device);
                                      });
    if (made) {
      subscriptions.push_back(std::move(*made));
    } else {
      problem = made.error();
    }
  };
  // Each with both qualities, because a reliable one does not match best-effort publishers, and a
  // best-effort one gets a lost message from no one again.
  add(Bool{}, Reliability::kReliable);
  add(Bool{}, Reliability::kBestEffort);
  add(Empty{}, Reliability::kReliable);
  add(Empty{}, Reliability::kBestEffort);
  if (problem) return unexpected{*problem};
  return subscriptions;
}

void StopRequests::remember(const std::string& device, const std::string& url) {
  delivery_.remember({device, url});
}

std::set<std::string> StopRequests::owed() const {
  std::set<std::string> devices;
  for (const gvd::StopResult& each : delivery_.owed())
    devices.insert(each.target.device);
  return devices;
}

void StopRequests::request(const std::string& device) {
  {
    const std::lock_guard lock(mutex_);
    wanted_.insert(device);
  }
  changed_.notify_one();
}

void StopRequests::run() {
  for (;;) {
    std::set<std::string> wanted;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, 1s, [this] { return !wanted_.empty() || is_stopping_; });
      wanted.swap(wanted_);
      if (wanted.empty() && is_stopping_) return;
    }
    for (const std::string& device : wanted)
      stop(device);
    if (wanted.empty() && !delivery_.owed().empty()) static_cast<void>(delivery_.retry());
  }
}

void StopRequests::stop(const std::string& device) {
  const gvd::StopReport report = delivery_.stop(device);
  std::string text = "ROS stopped " + (device.empty() ? std::string("every device") : device) +
                     ": " + std::to_string(report.stopped_count()) + " of " +
                     std::to_string(report.devices.size()) + " reached";
  for (const gvd::StopResult& each : report.devices) {
    if (!each.is_stopped) text += "; " + each.target.device + ": " + each.why;
  }
  if (report.search_error) text += "; " + report.search_error->text();
  log_.write(text);
}

}  // namespace rtpm::ros2
