#pragma once

#include <condition_variable>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "cyclone/participant.hpp"
#include "device_commands.hpp"
#include "device_topics.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/ros2/names.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "stop_requests.hpp"
#include "topic_events.hpp"

namespace rtpm::ros2 {

/// Configures a bridge.
struct BridgeConfig {
  std::string registry{};
  std::string hub{};
  std::string node = "rtpm";             ///< Its name in ROS.
  std::vector<std::string> devices{};    ///< Those shown; all if empty.
  double rate_hz = 200;                  ///< Maximum rate of each device's samples.
  bool has_tf = false;                   ///< Publishes poses as transforms.
  std::vector<std::string> commanded{};  ///< The devices that topics may command.
  CommandConfig command{};
  std::vector<Topic> events{};  ///< The topics passed to the hub.
};

/// Shows the devices of a laboratory as topics of ROS 2, commands them from topics, and passes
/// other topics to the hub. Devices come and go by their names; registry and hub may be absent at
/// first, and restart.
/// @ownership refers to its node; owns its threads "rtpm-ros2-out", "rtpm-ros2-in" and others
/// @threads  one
/// @realtime never
class Bridge final : private gvd::DeviceEventHandler {
 public:
  /// @errors   the domain can't be joined; no thread left
  [[nodiscard]] static expected<std::unique_ptr<Bridge>, SetupError> create(
      rpc::Node& node, const Domain& domain, const BridgeConfig& config, rt::Log& log);
  ~Bridge() override;

  /// Adds and removes devices; retries what failed. Call it some times per second; blocks at most
  /// some seconds, where programs do not answer.
  void attend();
  /// The counters in one line of text.
  [[nodiscard]] std::string report() const;

 private:
  /// One bound device.
  struct Shown {
    std::shared_ptr<DeviceTopics> topics{};
    std::shared_ptr<DeviceCommands> commands{};
    std::vector<std::unique_ptr<Subscription>> stops{};
  };
  using Targets = std::vector<std::shared_ptr<DeviceTopics>>;

  Bridge(rpc::Node& node, const BridgeConfig& config, rt::Log& log)
      : node_(node), config_(config), log_(log) {}
  [[nodiscard]] expected<void, SetupError> begin(const Domain& domain);
  void subscribe_to_hub();
  [[nodiscard]] expected<gvd::DeviceConsumer, SetupError> consume(
      const char* name, std::initializer_list<events::EventType> types,
      events::DeliveryPolicy delivery);
  void report_absent_devices();
  void watch_names();
  void note(const names::NameChange& change);
  void follow_names();
  [[nodiscard]] expected<void, SetupError> show(const std::string& name, const std::string& url);
  void hide(const std::string& name);
  void report_problem(const std::string& key, const std::string& text);
  void on_events(std::span<const gvd::DeviceEvent> events) override;
  void run();
  void publish_diagnostics(const Targets& targets);
  [[nodiscard]] DiagnosticStatus own_status() const;

  rpc::Node& node_;
  const BridgeConfig config_;
  rt::Log& log_;
  std::unique_ptr<Participant> participant_{};
  std::unique_ptr<Publisher> diagnostics_{};
  std::unique_ptr<Publisher> tf_{};
  std::unique_ptr<StopRequests> stops_{};
  std::unique_ptr<TopicEvents> topic_events_{};
  std::optional<gvd::DeviceConsumer> samples_{};
  std::optional<gvd::DeviceConsumer> changes_{};
  std::unique_ptr<names::NameWatch> watch_{};
  GivenNames given_{};
  std::map<std::string, std::string> problems_{};  ///< The last reported, by their subject.
  MonotonicTime next_retry_{};

  std::mutex names_mutex_;  ///< Guards the next member.
  /// Bound names with their URLs; nullopt: gone. Those that attend() has still to follow.
  std::map<std::string, std::optional<std::string>> changed_names_{};

  mutable std::mutex mutex_;  ///< Guards the next members.
  std::condition_variable changed_{};
  std::map<std::string, Shown> shown_{};
  std::map<events::SourceId, std::shared_ptr<DeviceTopics>> by_source_{};
  bool has_news_ = false;
  bool is_stopping_ = false;
  std::uint64_t unknown_count_ = 0;  ///< Events of devices that are not shown.

  rt::Thread thread_{};
};

}  // namespace rtpm::ros2
