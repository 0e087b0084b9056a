#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cyclone/participant.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::ros2 {

/// Parses "/camera/trigger:std_msgs/msg/Header"; also with "std_msgs/Header".
/// @errors   what was expected, in words
[[nodiscard]] expected<Topic, SetupError> parse_topic(std::string_view text);

/// Passes the messages of topics to a hub, as rtpm.ros2.MessageReceived.
/// @ownership refers to its node and participant
/// @threads  any
/// @realtime never
class TopicEvents {
 public:
  /// @errors   no hub answers; a topic can't be subscribed
  [[nodiscard]] static expected<std::unique_ptr<TopicEvents>, SetupError> create(
      rpc::Node& node, Participant& participant, const std::string& hub,
      const std::vector<Topic>& topics);
  TopicEvents(const TopicEvents&) = delete;
  TopicEvents& operator=(const TopicEvents&) = delete;

  [[nodiscard]] std::uint64_t pushed_count() const noexcept { return pushed_count_; }
  /// Messages that did not reach the hub: lost on the way, too large, or the hub was away.
  [[nodiscard]] std::uint64_t lost_count() const;

 private:
  explicit TopicEvents(std::unique_ptr<events::Supplier> supplier)
      : supplier_(std::move(supplier)) {}
  void push(const Topic& topic, const Received& message);

  const std::unique_ptr<events::Supplier> supplier_;
  std::atomic<std::uint64_t> pushed_count_{0};
  std::atomic<std::uint64_t> failed_count_{0};
  std::vector<std::unique_ptr<Subscription>> subscriptions_{};
};

}  // namespace rtpm::ros2
