#include "web/send_queue.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace rtpm::console {
namespace {

OutgoingFrame frame(const std::string& text) {
  return {.body = std::make_shared<const std::string>(text)};
}

std::string popped(SendQueue& queue) {
  const auto next = queue.pop();
  return next ? *next->body : "(none)";
}

TEST(SendQueues, SendControlBeforeData) {
  SendQueue queue;
  queue.push_data(frame("d1"));
  ASSERT_TRUE(queue.push_control(frame("c1")));
  ASSERT_TRUE(queue.push_control(frame("c2")));
  EXPECT_EQ(popped(queue), "c1");
  EXPECT_EQ(popped(queue), "c2");
  EXPECT_EQ(popped(queue), "d1");
  EXPECT_EQ(popped(queue), "(none)");
}

TEST(SendQueues, DropAndCountTheOldestData) {
  SendQueue queue;
  for (std::size_t i = 0; i < SendQueue::kDataCountMax + 3; ++i)
    queue.push_data(frame(std::to_string(i)));
  EXPECT_EQ(queue.dropped_count(), 3U);
  EXPECT_EQ(popped(queue), "3");
}

TEST(SendQueues, BoundTheBytesOfData) {
  SendQueue queue;
  const std::string large(SendQueue::kDataByteMax / 2, 'x');
  for (int i = 0; i < 10; ++i)
    queue.push_data(frame(large + std::to_string(i)));
  EXPECT_EQ(queue.dropped_count(), 9U);
  EXPECT_EQ(popped(queue).back(), '9');
  // A single message may exceed the limit on the sum.
  queue.push_data(frame(std::string(2 * SendQueue::kDataByteMax, 'y')));
  EXPECT_EQ(popped(queue).front(), 'y');
}

TEST(SendQueues, KeepTheNewestPicturesOnly) {
  SendQueue queue;
  queue.push_picture(1, frame("late"), false);
  EXPECT_EQ(popped(queue), "(none)") << "a subscription begins with a key frame";
  queue.push_picture(1, frame("key"), true);
  queue.push_picture(1, frame("next"), false);
  queue.push_picture(2, frame("other"), true);
  queue.push_data(frame("data"));
  EXPECT_EQ(popped(queue), "data") << "pictures delay nothing else";
  queue.push_picture(1, frame("key2"), true);
  EXPECT_EQ(popped(queue), "other");
  EXPECT_EQ(popped(queue), "key2");
  EXPECT_EQ(popped(queue), "(none)");
  EXPECT_EQ(queue.dropped_count(), 3U);
}

TEST(SendQueues, DropPicturesUpToTheNextKeyFrame) {
  SendQueue queue;
  queue.push_picture(1, frame("key"), true);
  for (std::size_t i = 1; i <= SendQueue::kPictureCountMax; ++i)
    queue.push_picture(1, frame(std::to_string(i)), false);
  EXPECT_EQ(queue.dropped_count(), 1U);
  while (queue.pop()) {
  }
  queue.push_picture(1, frame("needs what was dropped"), false);
  EXPECT_EQ(popped(queue), "(none)");
  queue.push_picture(1, frame("key"), true);
  queue.push_picture(1, frame("next"), false);
  EXPECT_EQ(popped(queue), "key");
  EXPECT_EQ(popped(queue), "next");
  const std::string large(SendQueue::kPictureByteMax, 'x');
  queue.push_picture(2, frame(large), true);
  queue.push_picture(3, frame(large), true);
  EXPECT_EQ(popped(queue).size(), large.size());
  EXPECT_EQ(popped(queue), "(none)") << "the bytes of all subscriptions are bounded";
}

TEST(SendQueues, RefuseControlAboveItsCountOrBytes) {
  SendQueue many;
  for (std::size_t i = 0; i < SendQueue::kControlCountMax; ++i)
    ASSERT_TRUE(many.push_control(frame("c")));
  EXPECT_FALSE(many.push_control(frame("c")));
  SendQueue queue;
  const std::string quarter(SendQueue::kControlByteMax / 4, 'x');
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(queue.push_control(frame(quarter)));
  EXPECT_FALSE(queue.push_control(frame("c")));
  EXPECT_EQ(popped(queue), quarter);
  EXPECT_TRUE(queue.push_control(frame("c")));
  SendQueue small(100);
  small.push_data(frame(std::string(60, 'x')));
  small.push_data(frame(std::string(60, 'y')));
  EXPECT_EQ(small.dropped_count(), 1U);
}

}  // namespace
}  // namespace rtpm::console
