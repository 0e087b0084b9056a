#include "live/event_inbox.hpp"

#include <gtest/gtest.h>

namespace rtpm::console {
namespace {

HubEvent event(EventStream stream, std::uint32_t number, std::size_t size = 8) {
  HubEvent made{.stream = stream};
  made.header.sequence = number;
  made.payload.resize(size);
  return made;
}

TEST(EventInboxes, NotifyOnceWhileEventsWait) {
  EventInbox inbox;
  EXPECT_TRUE(inbox.is_empty());
  EXPECT_TRUE(inbox.push(event(EventStream::kSample, 1)));
  EXPECT_FALSE(inbox.push(event(EventStream::kSample, 2)));
  EXPECT_EQ(inbox.pop()->header.sequence, 1u);
  EXPECT_EQ(inbox.pop()->header.sequence, 2u);
  EXPECT_FALSE(inbox.pop());
  EXPECT_TRUE(inbox.push(event(EventStream::kSample, 3)));
}

// A flood of one stream does not drop a device's changes.
TEST(EventInboxes, DropTheOldestOfTheirStreamOnly) {
  EventInbox inbox;
  static_cast<void>(inbox.push(event(EventStream::kChange, 7)));
  for (std::uint32_t i = 0; i < EventInbox::kCountMax + 5; ++i)
    static_cast<void>(inbox.push(event(EventStream::kGeneric, i)));
  EXPECT_EQ(inbox.dropped_count(), 5u);
  EXPECT_EQ(inbox.pop()->header.sequence, 7u);
  EXPECT_EQ(inbox.pop()->header.sequence, 5u);
}

TEST(EventInboxes, BoundTheBytes) {
  EventInbox inbox;
  for (std::uint32_t i = 0; i < 10; ++i)
    static_cast<void>(inbox.push(event(EventStream::kGeneric, i, EventInbox::kByteMax / 2)));
  EXPECT_EQ(inbox.dropped_count(), 9u);
  EXPECT_EQ(inbox.pop()->header.sequence, 9u);
  EXPECT_TRUE(inbox.is_empty());
}

}  // namespace
}  // namespace rtpm::console
