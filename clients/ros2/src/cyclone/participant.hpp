#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "cyclone/domain.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

struct ddsi_sertype;

namespace rtpm::ros2 {

/// A topic of ROS 2.
struct Topic {
  std::string name{};  ///< "/rtpm/lab/arm0/pose".
  std::string type{};  ///< "geometry_msgs/msg/PoseStamped".
  std::string hash{};  ///< "RIHS01_…"; empty if unknown.
};

enum class Reliability : std::uint8_t {
  kReliable,
  kBestEffort,  ///< As a subscriber, this also matches reliable publishers.
};

struct Quality {
  Reliability reliability = Reliability::kReliable;
  bool is_latched = false;  ///< Late subscribers receive the last message.
  std::int32_t depth = 5;
};

class Participant;

/// Publishes one topic. Ends with this object.
/// @ownership refers to its participant
/// @threads  one
class Publisher {
 public:
  Publisher(Participant& participant, std::int32_t writer, const ddsi_sertype* type) noexcept
      : participant_(participant), writer_(writer), type_(type) {}
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;
  ~Publisher();

  /// Sends a message. Waits at most 10 ms for a slow reliable subscriber.
  /// @return   false if it was not sent
  /// @realtime never
  bool publish(ConstBytes cdr);

 private:
  Participant& participant_;
  const std::int32_t writer_;
  const ddsi_sertype* const type_;
};

/// A message of a peer. Valid during the call.
struct Received {
  ConstBytes cdr{};                 ///< Empty if it was larger than the subscription takes.
  std::int64_t source_time_ns = 0;  ///< When it was sent, by the sender's CLOCK_REALTIME.
};
/// Runs on the thread "rtpm-ros2-in"; adds or removes no subscription.
using ReceivedHandler = std::function<void(const Received&)>;

/// Subscribes to one topic. Ends with this object, after a running handler.
/// @ownership refers to its participant
class Subscription {
 public:
  Subscription(Participant& participant, std::int32_t reader) noexcept
      : participant_(participant), reader_(reader) {}
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;
  ~Subscription();
  /// Messages that were lost on the way.
  [[nodiscard]] std::uint64_t lost_count() const;

 private:
  Participant& participant_;
  const std::int32_t reader_;
};

/// A program's part in a domain of ROS 2, with one node.
/// @threads  any
/// @realtime never
class Participant {
 public:
  /// @errors   the domain can't be joined, with the cause that Cyclone DDS gives
  [[nodiscard]] static expected<std::unique_ptr<Participant>, SetupError> create(
      const Domain& domain, std::string node);
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;
  /// All publishers and subscriptions have ended before.
  ~Participant();

  [[nodiscard]] expected<std::unique_ptr<Publisher>, SetupError> publish(const Topic& topic,
                                                                         const Quality& quality);
  /// @param size_max  in bytes of CDR; larger messages arrive empty
  [[nodiscard]] expected<std::unique_ptr<Subscription>, SetupError> subscribe(
      const Topic& topic, const Quality& quality, std::uint32_t size_max, ReceivedHandler handler);

 private:
  friend class Publisher;
  friend class Subscription;
  using Guid = std::array<std::uint8_t, 16>;
  struct Endpoint {
    std::int32_t entity = 0;
    ddsi_sertype* type = nullptr;
  };

  explicit Participant(std::string node) : node_(std::move(node)) {}
  [[nodiscard]] expected<void, SetupError> join(const Domain& domain);
  [[nodiscard]] expected<Endpoint, SetupError> add(const std::string& dds_name, const Topic& topic,
                                                   const Quality& quality, std::uint32_t size_max,
                                                   bool is_writer);
  void remove_writer(std::int32_t writer);
  void remove_reader(std::int32_t reader);
  void publish_graph();
  void run();
  void receive(std::int32_t reader, const ReceivedHandler& handler);

  const std::string node_;
  std::int32_t domain_ = 0;
  std::int32_t participant_ = 0;
  std::int32_t wait_set_ = 0;

  std::mutex graph_mutex_;  ///< Guards the next members.
  std::map<std::int32_t, Guid> writers_{};
  std::map<std::int32_t, Guid> readers_{};
  std::unique_ptr<Publisher> graph_{};

  std::mutex handler_mutex_;  ///< Guards `handlers_`; held while a handler runs.
  std::map<std::int32_t, ReceivedHandler> handlers_{};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::ros2
