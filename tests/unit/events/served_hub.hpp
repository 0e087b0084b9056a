#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "table.hpp"

/// A hub behind a server, and handlers that write down their deliveries.
namespace rtpm::events::test {

inline constexpr std::chrono::seconds kPatience{10};

/// A transport that loses nothing however fast a test pushes: shared memory, or TCP where the
/// system offers none.
inline rpc::Transport lossless_transport() {
  return transport::offers_shared_memory() ? rpc::Transport::kSharedMemory : rpc::Transport::kTcp;
}

/// Waits until `is_so()`; false if that does not happen in time.
template <class Condition>
[[nodiscard]] bool await(Condition is_so) {
  return rtpm::test::await(is_so, kPatience);
}

/// A hub that a test may stop and start again at the same address.
class ServedHub {
 public:
  explicit ServedHub(HubConfig config = {}) : config_(std::move(config)) {
    config_.realtime = rt::RealtimeMode::kOff;
    config_.priority.reset();
    start();
  }
  ~ServedHub() { stop(); }
  ServedHub(const ServedHub&) = delete;
  ServedHub& operator=(const ServedHub&) = delete;

  void start() {
    hub_ = rtpm::test::made(Hub::create(config_));
    auto settings = server_config_for(config_);
    settings.port = port_;
    server_ = rtpm::test::serve(kHubPath, hub_->servant(), settings);
    port_ = server_->port();
  }
  void stop() {
    if (server_) server_->stop();
    server_.reset();
    hub_.reset();
  }
  [[nodiscard]] Hub& hub() { return *hub_; }
  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(port_) + "/" + std::string(kHubPath);
  }

 private:
  HubConfig config_;
  std::uint16_t port_ = 0;
  std::unique_ptr<Hub> hub_{};
  std::unique_ptr<rpc::Server> server_{};
};

/// Writes down notices, and deliveries in Table's format.
class Recorder : public EventHandler {
 public:
  void on_events(std::span<const EventView> events) override {
    std::string text;
    for (const EventView& event : events) {
      if (!text.empty()) text += "+";
      text += name_of(event.header);
    }
    const std::lock_guard lock(mutex_);
    deliveries_.push_back(text);
    last_payload_.assign(events.back().payload.begin(), events.back().payload.end());
    last_header_ = events.back().header;
    is_aligned_ = reinterpret_cast<std::uintptr_t>(events.back().payload.data()) % 16 == 0;
    changed_.notify_all();
  }
  void on_notice(const Notice& notice) override {
    const std::lock_guard lock(mutex_);
    notices_.push_back(notice);
    texts_.emplace_back(notice.text);
    changed_.notify_all();
  }

  /// Waits until `is_so(*this)`, with the recorder locked; false if that does not happen in time.
  template <class Condition>
  [[nodiscard]] bool await(Condition is_so) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kPatience, [&] { return is_so(*this); });
  }
  [[nodiscard]] bool await_deliveries(std::size_t count) {
    return await([&](const Recorder& it) { return it.deliveries_.size() >= count; });
  }
  [[nodiscard]] bool await_notice(NoticeKind kind) {
    return await([&](const Recorder& it) { return it.has(kind); });
  }
  [[nodiscard]] bool has(NoticeKind kind) const {
    return std::ranges::any_of(notices_, [&](const Notice& each) { return each.kind == kind; });
  }
  /// All deliveries so far, separated by blanks.
  [[nodiscard]] std::string text() {
    const std::lock_guard lock(mutex_);
    std::string text;
    for (const std::string& each : deliveries_)
      text += (text.empty() ? "" : " ") + each;
    return text;
  }
  [[nodiscard]] Notice notice(NoticeKind kind) {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find(notices_, kind, &Notice::kind);
    EXPECT_NE(found, notices_.end());
    return found == notices_.end() ? Notice{} : *found;
  }

  [[nodiscard]] std::string notice_text(NoticeKind kind) {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < notices_.size(); ++i) {
      if (notices_[i].kind == kind) return texts_[i];
    }
    return {};
  }

  std::vector<std::string> deliveries_{};
  std::vector<Notice> notices_{};
  std::vector<std::string> texts_{};
  std::vector<std::byte> last_payload_{};
  EventHeader last_header_{};
  bool is_aligned_ = false;

 protected:
  std::mutex mutex_{};
  std::condition_variable changed_{};
};

/// Blocks its thread until the test releases it.
class Sleeper final : public Recorder {
 public:
  void on_events(std::span<const EventView> events) override {
    Recorder::on_events(events);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_free; });
  }
  void release() {
    const std::lock_guard lock(mutex_);
    is_free = true;
    changed_.notify_all();
  }
  bool is_free = false;
};

inline constexpr EventDescriptor kPoseDescriptor{kPose, "lab.Pose", kPoseSchema, kPoseFields};

/// Not connected directly to the hub's lane, which limits concurrent calls: tests push as fast as
/// they can.
inline std::unique_ptr<Supplier> make_supplier(rpc::Node& node, const ServedHub& hub,
                                               rpc::Transport transport = lossless_transport()) {
  return rtpm::test::made(Supplier::create(
      node, hub.url(),
      {.types = {&kPoseDescriptor}, .transport = transport, .deadline = kPatience}));
}

inline std::unique_ptr<Consumer> make_consumer(rpc::Node& node, const ServedHub& hub,
                                               EventHandler& handler, const Filter& filter,
                                               const DeliveryPolicy& delivery = {},
                                               rpc::Transport transport = rpc::Transport::kAuto,
                                               bool shared_ring = false) {
  return rtpm::test::made(Consumer::create(node, hub.url(),
                                           {.filter = filter,
                                            .delivery = delivery,
                                            .realtime = rt::RealtimeMode::kOff,
                                            .transport = transport,
                                            .shared_ring = shared_ring,
                                            .deadline = kPatience},
                                           handler));
}

/// Pushes a pose or another event with a pose's payload.
inline void push(Supplier& supplier, EventType type, SourceId source = 0,
                 const PosePayload& payload = {}) {
  const auto bytes = std::as_bytes(std::span<const PosePayload, 1>(&payload, 1));
  const auto pushed =
      supplier.push({.type = type, .source = source, .schema_id = kPoseSchema, .payload = bytes});
  EXPECT_TRUE(pushed) << rpc::to_string(pushed.error());
}

/// A payload that an event needs several parts for.
inline std::vector<std::byte> large_payload() {
  std::vector<std::byte> payload(60'000);
  for (std::size_t i = 0; i < payload.size(); ++i)
    payload[i] = static_cast<std::byte>(i * 31);
  return payload;
}

/// Waits until the hub has taken `count` events.
inline void await_taken(const Hub& hub, std::uint64_t count) {
  EXPECT_TRUE(await([&] { return hub.intake().taken_count >= count; }));
  EXPECT_EQ(hub.intake().taken_count, count);
}

/// Subscribes with several filters through `join(handler, filter)`: the deliveries are the same on
/// every path.
template <class Join>
void expect_filtered_deliveries(rpc::Node& node, const ServedHub& hub, const Join& join,
                                rpc::Transport transport = lossless_transport()) {
  const auto supplier = make_supplier(node, hub, transport);
  Recorder poses;
  Recorder buttons;
  Recorder pairs;
  const auto first = join(poses, where(kPose, "x", Comparison::kGreater, Scalar::of(1)));
  const auto second = join(buttons, of_type(kButton));
  const auto third =
      join(pairs, any_of({of_type(kButton), correlate({of_type(kButton), of_type(kPose)})}));
  push(*supplier, kButton, 2);
  push(*supplier, kPose, 1, {.x = 0.5});
  push(*supplier, kPose, 1, {.x = 1.5});
  ASSERT_TRUE(poses.await_deliveries(1));
  ASSERT_TRUE(buttons.await_deliveries(1));
  ASSERT_TRUE(pairs.await_deliveries(2));
  EXPECT_EQ(poses.text(), "5.1#2");
  EXPECT_EQ(buttons.text(), "6.2#1");
  EXPECT_EQ(pairs.text(), "6.2#1 6.2#1+5.1#1");
  EXPECT_TRUE(poses.is_aligned_);
  EXPECT_EQ(poses.last_payload_.size(), sizeof(PosePayload));
  EXPECT_LE(poses.last_header_.origin, poses.last_header_.hub_received);
  EXPECT_LE(poses.last_header_.hub_received, poses.last_header_.hub_sent);
}

/// Changes, suspends and resumes a subscription of poses between events: the deliveries are the
/// same on every path.
inline void change_suspend_and_resume(const Hub& hub, Supplier& supplier, Consumer& consumer,
                                      Recorder& recorder) {
  push(supplier, kPose);
  ASSERT_TRUE(recorder.await_deliveries(1));
  ASSERT_TRUE(consumer.change(of_type(kButton), {.queue_capacity = 5}));
  push(supplier, kPose);
  push(supplier, kButton);
  ASSERT_TRUE(recorder.await_deliveries(2));
  ASSERT_TRUE(consumer.suspend());
  push(supplier, kButton);
  await_taken(hub, 4);
  ASSERT_TRUE(consumer.resume());
  push(supplier, kButton);
  ASSERT_TRUE(recorder.await_deliveries(3));
  EXPECT_EQ(recorder.text(), "5.0#1 6.0#1 6.0#3");
}

}  // namespace rtpm::events::test
