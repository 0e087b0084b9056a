#include "rtpm/transport/merged_descriptor.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <array>
#include <memory>
#include <vector>

#include "frames.hpp"
#include "os/native_socket.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::transport {
namespace {

using namespace std::chrono_literals;

class MergedDescriptorTest : public testing::Test {
 protected:
  [[nodiscard]] bool is_readable(int timeout_ms = 0) const {
    auto entry = os::polled(merged_->number());
    return poll(&entry, 1, timeout_ms) == 1;
  }
  /// Whether it becomes readable; some systems take a moment.
  [[nodiscard]] bool becomes_readable() const { return is_readable(20'000); }
  [[nodiscard]] std::vector<std::uint64_t> take() {
    std::array<std::uint64_t, 8> room{};
    const auto tags = merged_->take(room);
    return {tags.begin(), tags.end()};
  }
  Descriptor readable() {
    auto [near, far] = test::stream_pair();
    test::write_all(far, test::Bytes(1));
    far_ends_.push_back(std::move(far));
    return std::move(near);
  }

  std::vector<Descriptor> far_ends_{};
  std::unique_ptr<MergedDescriptor> merged_ = std::move(*MergedDescriptor::open());
};

TEST_F(MergedDescriptorTest, ReportsADescriptorOncePerWatch) {
  const Descriptor one = readable();
  ASSERT_TRUE(merged_->watch(one.number(), 7));
  EXPECT_TRUE(becomes_readable());
  EXPECT_EQ(take(), std::vector<std::uint64_t>{7});
  EXPECT_FALSE(is_readable());
  ASSERT_TRUE(merged_->watch(one.number(), 8));
  EXPECT_TRUE(becomes_readable());
  EXPECT_EQ(take(), std::vector<std::uint64_t>{8});
  ASSERT_TRUE(merged_->watch(one.number(), 9));
  merged_->unwatch(one.number());
  EXPECT_FALSE(is_readable());
}

TEST_F(MergedDescriptorTest, StaysReadableUntilAllAreReported) {
  std::vector<Descriptor> many;
  for (std::uint64_t tag = 0; tag < 20; ++tag) {
    many.push_back(readable());
    ASSERT_TRUE(merged_->watch(many.back().number(), tag));
  }
  std::size_t count = 0;
  while (count < many.size() && becomes_readable())
    count += take().size();
  EXPECT_EQ(count, many.size());
  EXPECT_FALSE(is_readable());
}

TEST_F(MergedDescriptorTest, IsReadableAfterTheAlarmUntilTheNext) {
  merged_->set_alarm(rt::now() + 2ms);
  EXPECT_TRUE(becomes_readable());
  EXPECT_TRUE(take().empty());
  EXPECT_TRUE(is_readable());
  merged_->set_alarm(rt::now() + 1h);
  EXPECT_FALSE(is_readable());
  merged_->set_alarm(MonotonicTime{});
  EXPECT_TRUE(becomes_readable()) << "a time that has passed";
  merged_->set_alarm(kNever);
  EXPECT_FALSE(is_readable());
}

TEST_F(MergedDescriptorTest, IsReadableAfterARingUntilItIsTaken) {
  merged_->ring();
  merged_->ring();
  EXPECT_TRUE(is_readable());
  EXPECT_TRUE(take().empty());
  EXPECT_FALSE(is_readable());
}

// A child process may have the descriptor, too.
TEST_F(MergedDescriptorTest, ReportsAClosedDescriptorThatHasADuplicateAtMostOnce) {
  Descriptor one = readable();
  const Descriptor duplicate = os::duplicate(one.number());
  ASSERT_TRUE(merged_->watch(one.number(), 7));
  one = Descriptor();
  static_cast<void>(take());
  EXPECT_FALSE(is_readable());
}

}  // namespace
}  // namespace rtpm::transport
