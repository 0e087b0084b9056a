#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/transport/wait_set.hpp"

/// One suite for every implementation of WaitSet, with few and many sources, with and without a
/// lock.
namespace rtpm::transport::test {

inline constexpr SourceKind kPort{1};
inline constexpr SourceKind kSocket{2};
inline constexpr SourceKind kIdle{3};
inline constexpr std::size_t kSourceCountMax = 64;

enum class Kind { kPolledFew, kPolledMany, kPolledEdge, kPortAlone, kPortAndOthers };

struct Way {
  Kind kind;
  bool is_held;
};

inline std::string name_of(const testing::TestParamInfo<Way>& way) {
  const std::array names{"PolledFew", "PolledMany", "PolledEdge", "PortAlone", "PortAndOthers"};
  return std::string(names.at(static_cast<std::size_t>(way.param.kind))) +
         (way.param.is_held ? "WithALock" : "");
}

/// Counts how often it was released, and records its holder.
class CountingLock final : public WaitLock {
 public:
  void lock() noexcept override {
    mutex_.lock();
    is_locked = true;
  }
  void unlock() noexcept override {
    ++unlock_count;
    is_locked = false;
    mutex_.unlock();
  }

  std::atomic<int> unlock_count = 0;
  std::atomic<bool> is_locked = false;

 private:
  std::mutex mutex_;
};

[[nodiscard]] inline int ring_count_of_a_run() {
  const char* const text = std::getenv("RTPM_RINGS");
  return text == nullptr ? 3000 : std::atoi(text);
}

using Tags = std::vector<std::uint64_t>;

[[nodiscard]] inline Tags tags_of(std::initializer_list<SourceTag> tags) {
  Tags raw;
  for (const SourceTag tag : tags)
    raw.push_back(tag.raw());
  std::ranges::sort(raw);
  return raw;
}

class WaitSetTest : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override {
    if (has_port()) {
      open_port();
    } else {
      auto opened = WaitSet::open(kSourceCountMax);
      ASSERT_TRUE(opened);
      set_ = std::move(*opened);
    }
    if (GetParam().kind == Kind::kPolledMany) add_idle(12, Trigger::kLevel);
    if (GetParam().kind == Kind::kPolledEdge) add_idle(1, Trigger::kEdge);
    if (GetParam().kind == Kind::kPortAndOthers) add_idle(2, Trigger::kLevel);
  }
  void TearDown() override {
    if (port_) set_->remove(port_->descriptor());
  }

  [[nodiscard]] static bool has_port() {
    return GetParam().kind == Kind::kPortAlone || GetParam().kind == Kind::kPortAndOthers;
  }
  void open_port() {
    const auto listener = TcpListener::open("127.0.0.1", 0);
    ASSERT_TRUE(listener);
    auto port = UdpPort::open({.port = listener->port()});
    ASSERT_TRUE(port);
    port_.emplace(std::move(*port));
    caller_ = std::move(*open_udp_transport("127.0.0.1", listener->port(), 0));
    auto opened = WaitSet::open_for_lane(kSourceCountMax);
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->add_port(*port_, buffer_, SourceTag(kPort)));
    set_ = std::move(*opened);
  }
  void add_idle(std::uint32_t count, Trigger trigger) {
    for (std::uint32_t i = 0; i < count; ++i) {
      idle_.push_back(stream_pair());
      ASSERT_TRUE(set_->add(idle_.back().first.number(), SourceTag(kIdle, i), trigger));
    }
  }

  /// The sorted tags of at most `capacity` ready sources.
  Tags wait(MonotonicTime until, std::size_t capacity = 16) {
    std::vector<SourceTag> ready(capacity);
    if (GetParam().is_held) lock_.lock();
    const std::size_t count = set_->wait(until, ready, GetParam().is_held ? &lock_ : nullptr);
    if (GetParam().is_held) {
      EXPECT_TRUE(lock_.is_locked) << "the lock is back";
      lock_.unlock();
    }
    Tags tags;
    for (std::size_t i = 0; i < count; ++i)
      tags.push_back(ready[i].raw());
    std::ranges::sort(tags);
    return tags;
  }
  Tags poll(std::size_t capacity = 16) { return wait(kAlready, capacity); }
  /// Waits again when a wait ends early, like a lane.
  Tags await_some() {
    Tags tags;
    for (const MonotonicTime end = rt::now() + std::chrono::seconds{10};
         tags.empty() && rt::now() < end;)
      tags = wait(end);
    return tags;
  }
  [[nodiscard]] bool receive() { return port_->receive(buffer_).has_value(); }
  /// Receives all pending datagrams.
  void drain() {
    while (port_ && receive()) {
    }
  }

  std::optional<UdpPort> port_;
  std::unique_ptr<ClientTransport> caller_;
  alignas(64) std::array<std::byte, Datagrams::kSizeMax> buffer_{};
  std::vector<std::pair<Descriptor, Descriptor>> idle_;
  std::unique_ptr<WaitSet> set_;
  CountingLock lock_;
};

class WaitSetWithALock : public WaitSetTest {};
class WaitSetWithAPort : public WaitSetTest {};

inline std::vector<Way> ways(std::span<const Kind> kinds, std::initializer_list<bool> holds) {
  std::vector<Way> all;
  for (const Kind kind : kinds) {
    for (const bool is_held : holds)
      all.push_back({kind, is_held});
  }
  return all;
}

inline constexpr std::array kAllKinds{Kind::kPolledFew, Kind::kPolledMany, Kind::kPolledEdge,
                                      Kind::kPortAlone, Kind::kPortAndOthers};

}  // namespace rtpm::transport::test
