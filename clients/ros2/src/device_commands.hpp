#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "command_check.hpp"
#include "cyclone/participant.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/ros2/messages.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::ros2 {

/// Configures commands from topics.
struct CommandConfig {
  /// How long a command lasts without a newer one; the device limits it further.
  Duration hold = std::chrono::milliseconds{100};
  /// How much a command's stamp may differ from this host's clock.
  Duration age_max = std::chrono::milliseconds{200};
};

/// Commands one device from topics. Acquires the lease at the first command, and releases it a
/// second after the last one. It never takes a lease back from an operator who took it over, until
/// the commands have paused that long. The newest command wins; the device's own limits apply.
/// @ownership refers to its node and participant; owns its thread "rtpm-ros2-cmd"
/// @threads  any
/// @realtime never
class DeviceCommands {
 public:
  /// @errors   the device does not answer, or takes no command that has a topic
  [[nodiscard]] static expected<std::unique_ptr<DeviceCommands>, SetupError> create(
      rpc::Node& node, Participant& participant, const std::string& device,
      const CommandConfig& config);
  DeviceCommands(const DeviceCommands&) = delete;
  DeviceCommands& operator=(const DeviceCommands&) = delete;
  /// Releases the lease.
  ~DeviceCommands();

  /// Adds the counts of passed and dropped commands, and whether the bridge holds the lease.
  void report(std::vector<KeyValue>& values) const;
  /// "passed 17, stale stamp 3".
  [[nodiscard]] std::string counts() const;

 private:
  struct Waiting {
    driver::Setpoint setpoint{};
    MonotonicTime arrived{};
  };

  DeviceCommands(gvd::DeviceClient client, const CommandConfig& config)
      : client_(std::move(client)), config_(config) {}
  [[nodiscard]] expected<void, SetupError> open(Participant& participant,
                                                const std::string& device);
  void take(CommandKind kind, const Received& message);
  void run();
  [[nodiscard]] std::optional<Waiting> next();
  void command(const Waiting& waiting);
  [[nodiscard]] gvd::DeviceResult ensure_lease();
  void release();
  void drop(CommandDrop why);

  gvd::DeviceClient client_;  ///< Used by the thread only, except its descriptor.
  const CommandConfig config_;
  bool may_acquire_ = true;  ///< Else it only reacquires. For the thread.
  MonotonicTime last_{};     ///< The time of the last command. For the thread.

  mutable std::mutex mutex_;  ///< Guards the next members.
  std::condition_variable changed_{};
  std::optional<Waiting> waiting_{};
  std::array<std::uint64_t, kCommandDropCount> drop_counts_{};
  std::uint64_t passed_count_ = 0;
  bool has_lease_ = false;
  std::string refusal_{};  ///< The newest reason of kRefused.
  bool is_stopping_ = false;

  rt::Thread thread_{};
  /// Destroyed first: their handlers use the rest.
  std::vector<std::unique_ptr<Subscription>> subscriptions_{};
};

}  // namespace rtpm::ros2
