#include "rtpm/transport/broadcast_memory.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::transport {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kSize = 8192;

/// Memory, a door to it, and a thread that admits readers.
class Broadcast : public testing::Test {
 protected:
  void SetUp() override {
    auto memory = BroadcastMemory::make(kSize);
    ASSERT_TRUE(memory) << memory.error().text();
    memory_.emplace(std::move(*memory));
    auto door = BroadcastDoor::open(id_);
    ASSERT_TRUE(door) << door.error().text();
    door_.emplace(std::move(*door));
  }
  /// A view; the door is open for it meanwhile.
  expected<BroadcastView, SetupError> view() {
    std::thread porter([this] {
      static_cast<void>(wait_readable(door_->descriptor(), rt::now() + 10s));
      door_->let_in(*memory_);
    });
    auto view = BroadcastView::open(id_, rt::now() + 10s);
    porter.join();
    return view;
  }

  const std::uint64_t id_ = rt::random_u64();
  std::optional<BroadcastMemory> memory_{};
  std::optional<BroadcastDoor> door_{};
};

TEST_F(Broadcast, ReaderSeesWrittenBytes) {
  const auto seen = view();
  ASSERT_TRUE(seen) << seen.error().text();
  ASSERT_EQ(seen->bytes().size(), kSize);
  memory_->bytes()[100] = std::byte{42};
  EXPECT_EQ(seen->bytes()[100], std::byte{42});
}

TEST_F(Broadcast, MaliciousReaderCannotWriteIt) {
  const int descriptor = memory_->descriptor();
  EXPECT_EQ(mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0), MAP_FAILED);
  EXPECT_LT(write(descriptor, "x", 1), 0);
  EXPECT_NE(ftruncate(descriptor, 0), 0);
  // Reopening the descriptor through /proc does not help, either.
  const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
  const Descriptor again(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (again.is_open()) {
    EXPECT_EQ(mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, again.number(), 0),
              MAP_FAILED);
    EXPECT_LT(pwrite(again.number(), "x", 1, 0), 0);
  }
  const auto seen = view();
  ASSERT_TRUE(seen);
  EXPECT_NE(mprotect(const_cast<std::byte*>(seen->bytes().data()), kSize, PROT_READ | PROT_WRITE),
            0);
}

TEST_F(Broadcast, ReaderThatSleepsIsWokenForItsBit) {
  auto seen = view();
  ASSERT_TRUE(seen);
  const std::uint32_t value = seen->bell().value();
  std::thread sleeper([&] {
    while (seen->bell().value() == value)
      seen->bell().sleep(value, 2, kNever);
  });
  memory_->bell().ring(2);
  sleeper.join();
  EXPECT_NE(seen->bell().value(), value);
}

TEST_F(Broadcast, SleeperWakesWithoutARingAtTheLatestByItsInterval) {
  auto seen = view();
  ASSERT_TRUE(seen);
  // Simulates a peer that resets the word after the writer's ring, so that the ring is invisible.
  const MonotonicTime begin = rt::now();
  seen->bell().sleep(seen->bell().value(), 2, kNever);
  EXPECT_GE(rt::now() - begin, Duration{0}) << "and it returned";
}

TEST_F(Broadcast, BellIsNotMappedFromAnotherDescriptor) {
  EXPECT_FALSE(BroadcastBell::map(-1).has_value());
  EXPECT_FALSE(BroadcastBell::map(door_->descriptor()).has_value());
}

TEST(BroadcastView, FailsWithoutADoor) {
  const auto none = BroadcastView::open(rt::random_u64(), rt::now() + 10ms);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text().find("Remedy"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::transport
