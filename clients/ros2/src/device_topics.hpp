#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "cyclone/participant.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/ros2/device_messages.hpp"

namespace rtpm::ros2 {

/// Counters of a device's topics.
struct DeviceTopicsCounters {
  std::uint64_t published_count = 0;  ///< Messages.
  std::uint64_t failed_count = 0;     ///< Messages that a slow subscriber kept from being sent.
  std::uint64_t replaced_count = 0;   ///< Samples that a newer one replaced before they were sent.
  std::uint64_t lost_edge_count = 0;  ///< Presses and releases beyond those that may wait.
};

/// The topics that show one device.
/// @threads  take() from the consumers' threads, the rest from one
/// @realtime never
class DeviceTopics {
 public:
  /// @param name  of the device, "lab/arm0"
  /// @param tf    receives its pose as a transform, if not null; outlives this object
  [[nodiscard]] static expected<std::unique_ptr<DeviceTopics>, SetupError> create(
      Participant& participant, std::string name, const driver::Descriptor& descriptor,
      Publisher* tf);

  /// Takes a sample or a change, for publish().
  void take(const gvd::DeviceEvent& event);
  /// Publishes the newest sample and all edges of buttons since the last call.
  void publish();
  /// Whether faults, lifecycle, lease or stop have changed since the last status().
  [[nodiscard]] bool is_changed();
  /// The device's state, with all faults since the last call.
  [[nodiscard]] DiagnosticStatus status(MonotonicTime now);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept { return descriptor_; }
  [[nodiscard]] DeviceTopicsCounters counters() const;

 private:
  /// A press or release, with the state of all buttons after it.
  struct Edge {
    std::uint32_t buttons = 0;
    MonotonicTime origin{};
  };
  struct Sampled {
    driver::Sample sample{};
    MonotonicTime origin{};
  };

  DeviceTopics(std::string name, const driver::Descriptor& descriptor, Publisher* tf)
      : name_(std::move(name)), descriptor_(descriptor), tf_(tf) {}
  [[nodiscard]] expected<void, SetupError> open(Participant& participant);
  void take_sample(const driver::Sample& sample, const events::EventHeader& header);
  void take_edge(const gvd::ButtonChange& change, MonotonicTime origin);
  void publish_edge(const Edge& edge);
  void publish_sample(const Sampled& newest);
  void publish_stop(bool is_stopped);
  template <class Message>
  void send(const std::unique_ptr<Publisher>& publisher, const Message& message);
  void count(bool is_sent);

  const std::string name_;
  const driver::Descriptor descriptor_;
  Publisher* const tf_;
  std::unique_ptr<Publisher> pose_{};
  std::unique_ptr<Publisher> twist_{};
  std::unique_ptr<Publisher> wrench_{};
  std::unique_ptr<Publisher> joints_{};
  std::unique_ptr<Publisher> joy_{};
  std::unique_ptr<Publisher> imu_{};
  std::unique_ptr<Publisher> stopped_{};
  std::unique_ptr<Publisher> description_{};
  std::vector<std::byte> bytes_{};

  // The publishing thread alone uses these.
  driver::Sample shown_{};    ///< The newest published sample.
  MonotonicTime joy_time_{};  ///< The time of the newest message of joy_.
  std::optional<bool> shown_stop_{};

  mutable std::mutex mutex_;  ///< Guards the next members.
  std::optional<Sampled> waiting_{};
  std::vector<Edge> edges_{};
  std::uint32_t buttons_ = 0;         ///< After the newest edge.
  driver::Faults faults_{};           ///< Since the last status().
  std::optional<bool> is_stopped_{};  ///< If it was reported.
  gvd::LeaseState lease_ = gvd::LeaseState::kUnknown;
  std::optional<MonotonicTime> newest_{};  ///< The origin of the newest sample.
  std::uint32_t uncertainty_ns_ = 0;       ///< The uncertainty of `newest_`.
  bool is_changed_ = true;
  DeviceTopicsCounters counters_{};
};

}  // namespace rtpm::ros2
