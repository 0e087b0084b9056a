#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "rtpm/events/link.hpp"
#include "served_hub.hpp"

// Hubs that are linked (ev-5).
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

class HubLinks : public testing::Test {
 protected:
  /// Lets `hub` subscribe to `other` from now on.
  void link(ServedHub& hub, const ServedHub& other, bool shared_ring = false) {
    const auto linked = hub.hub().link(node_, other.url(),
                                       {.realtime = rt::RealtimeMode::kOff,
                                        .shared_ring = shared_ring,
                                        .deadline = kPatience,
                                        .attend_interval = 20ms});
    ASSERT_TRUE(linked) << linked.error().text();
  }
  /// Waits until the link asks for `count` types and sources.
  static void await_interest(ServedHub& hub, std::size_t count, std::size_t number = 0) {
    EXPECT_TRUE(await([&] {
      const LinkStatus status = hub.hub().links().at(number);
      return status.state == LinkState::kLinked && status.interest_count == count;
    })) << hub.hub().links().at(number).reason;
  }
  [[nodiscard]] std::unique_ptr<Supplier> supply(const ServedHub& hub, std::uint8_t hops) {
    return rtpm::test::made(Supplier::create(node_, hub.url(),
                                             {.types = {&kPoseDescriptor},
                                              .hops = hops,
                                              .transport = lossless_transport(),
                                              .deadline = kPatience}));
  }

  rpc::Node node_{};
  Recorder recorder_{};
};

class HubLinkBy : public HubLinks, public testing::WithParamInterface<bool> {};

// ev-5.1-2, ev-5.2-1
TEST_P(HubLinkBy, CarriesExactlyTheInterestOfConsumers) {
  ServedHub far;
  ServedHub near;
  link(near, far, GetParam());
  const auto consumer = make_consumer(node_, near, recorder_, of_type(kPose, 1));
  await_interest(near, 1);
  const auto supplier = supply(far, 1);
  push(*supplier, kButton);
  push(*supplier, kPose, 2);
  push(*supplier, kPose, 1, {.x = 2.5});
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "5.1#1");
  EXPECT_EQ(recorder_.last_payload_.size(), sizeof(PosePayload));
  EXPECT_EQ(recorder_.last_header_.hops_left, 0);
  EXPECT_LE(recorder_.last_header_.origin, recorder_.last_header_.hub_received);
  EXPECT_EQ(near.hub().links()[0].taken_count, 1U);
  EXPECT_EQ(near.hub().links()[0].repeated_count, 0U);
  EXPECT_EQ(near.hub().links()[0].refused_count, 0U) << "the others did not even come";
}
INSTANTIATE_TEST_SUITE_P(Ways, HubLinkBy, testing::Bool(), [](const auto& each) {
  return std::string(each.param ? "ring" : "stream");
});

// ev-5.2-1
TEST_F(HubLinks, FollowTheInterestOfConsumers) {
  ServedHub far;
  ServedHub near;
  link(near, far);
  await_interest(near, 0);
  const auto supplier = supply(far, 1);
  push(*supplier, kPose);
  const auto poses = make_consumer(node_, near, recorder_, of_type(kPose));
  await_interest(near, 1);
  push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  {
    Recorder others;
    const auto two = make_consumer(node_, near, others, any_of({of_type(kButton), of_type(kGaze)}));
    await_interest(near, 3);
    push(*supplier, kGaze);
    ASSERT_TRUE(others.await_deliveries(1));
  }
  await_interest(near, 1);
  push(*supplier, kGaze);
  ASSERT_TRUE(poses->change(of_type(kButton), {}));
  EXPECT_TRUE(await([&] {
    push(*supplier, kButton);
    return recorder_.text().find("6.0") != std::string::npos;
  }));
  EXPECT_TRUE(recorder_.text().starts_with("5.0#2 6.0#")) << recorder_.text();
}

// ev-5.1-2, ev-5.2-2 and ev-5.2-4
TEST_F(HubLinks, ForwardEventsAsFarAsTheirHopsAllow) {
  ServedHub first;
  ServedHub second;
  ServedHub third;
  link(second, first);
  link(third, second);
  const auto far = make_consumer(node_, third, recorder_, of_type(kPose));
  await_interest(third, 1);
  await_interest(second, 1);
  const auto stays = supply(first, 0);
  const auto goes_one = supply(first, 1);
  const auto goes_two = supply(first, 2);
  push(*stays, kPose, 0);
  push(*goes_one, kPose, 1);
  push(*goes_two, kPose, 2);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  // An event without enough hops does not even cross the first link.
  EXPECT_EQ(second.hub().links()[0].taken_count, 1U);
  Recorder at_second;
  const auto near = make_consumer(node_, second, at_second, of_type(kPose));
  EXPECT_TRUE(await([&] {
    push(*goes_one, kPose, 1);
    return !at_second.text().empty();
  }));
  EXPECT_TRUE(at_second.text().starts_with("5.1#"));
  push(*goes_two, kPose, 2);
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "5.2#1 5.2#2");
  EXPECT_EQ(third.hub().links()[0].taken_count, 2U);
}

// ev-5.3-1 and ev-5.3-2; in the end ev-5.2-3
TEST_F(HubLinks, DeliverOnceInARing) {
  std::vector<std::unique_ptr<ServedHub>> hubs;
  std::vector<std::unique_ptr<Recorder>> recorders;
  std::vector<std::unique_ptr<Consumer>> consumers;
  for (int i = 0; i < 3; ++i) {
    hubs.push_back(std::make_unique<ServedHub>());
    recorders.push_back(std::make_unique<Recorder>());
  }
  // Each hub asks both other hubs: a ring in both directions.
  for (std::size_t i = 0; i < 3; ++i) {
    link(*hubs[i], *hubs[(i + 1) % 3]);
    link(*hubs[i], *hubs[(i + 2) % 3]);
    consumers.push_back(make_consumer(node_, *hubs[i], *recorders[i],
                                      any_of({of_type(kPose), of_type(kButton)}),
                                      {.queue_capacity = 1000}));
  }
  for (const auto& each : hubs) {
    for (const std::size_t number : {0U, 1U})
      await_interest(*each, 2, number);
  }
  const auto supplier = supply(*hubs[0], 8);
  const auto other = supply(*hubs[1], 8);
  constexpr std::size_t kCount = 50;
  for (std::size_t i = 0; i < kCount; ++i) {
    push(*supplier, kPose);
    push(*other, kPose);
  }
  // The last event follows all duplicates.
  for (const auto& each : recorders)
    ASSERT_TRUE(each->await_deliveries(2 * kCount));
  const auto repeated = [&] {
    std::uint64_t count = 0;
    for (const auto& each : hubs) {
      for (const LinkStatus& link : each->hub().links())
        count += link.repeated_count;
    }
    return count;
  };
  EXPECT_TRUE(await([&] { return repeated() > 0; }));
  push(*supplier, kButton);
  for (const auto& each : recorders) {
    ASSERT_TRUE(each->await([](const Recorder& it) { return it.deliveries_.back() == "6.0#1"; }));
    EXPECT_EQ(each->deliveries_.size(), 2 * kCount + 1);
  }
  // ev-5.2-2: ended interest does not circulate.
  consumers.clear();
  for (const auto& each : hubs) {
    for (const std::size_t number : {0U, 1U})
      await_interest(*each, 0, number);
  }
}

// ev-5.3-2
TEST_F(HubLinks, DeliverOnceOverTwoPaths) {
  ServedHub source;
  ServedHub left;
  ServedHub right;
  ServedHub sink;
  link(left, source);
  link(right, source);
  link(sink, left);
  link(sink, right);
  const auto consumer =
      make_consumer(node_, sink, recorder_, of_type(kPose), {.queue_capacity = 1000});
  for (ServedHub* each : {&sink, &left, &right})
    await_interest(*each, 1);
  await_interest(sink, 1, 1);
  const auto supplier = supply(source, 2);
  constexpr std::size_t kCount = 100;
  for (std::size_t i = 1; i <= kCount; ++i) {
    push(*supplier, kPose);
    ASSERT_TRUE(await([&] {
      const auto links = sink.hub().links();
      return links[0].taken_count + links[0].repeated_count == i &&
             links[1].taken_count + links[1].repeated_count == i;
    }));
  }
  ASSERT_TRUE(recorder_.await_deliveries(kCount));
  const auto links = sink.hub().links();
  EXPECT_EQ(links[0].taken_count + links[1].taken_count, kCount);
  EXPECT_EQ(links[0].repeated_count + links[1].repeated_count, kCount);
  EXPECT_EQ(recorder_.last_header_.sequence, kCount) << recorder_.text();
}

// ev-5.3-3
TEST_F(HubLinks, ForwardEventsWithoutSequenceOnce) {
  ServedHub first;
  ServedHub second;
  ServedHub third;
  link(second, first);
  link(third, second);
  Recorder at_second;
  const auto near = make_consumer(node_, second, at_second, of_type(kPose));
  const auto far = make_consumer(node_, third, recorder_, of_type(kPose));
  await_interest(third, 1);
  await_interest(second, 1);
  alignas(16) std::array<std::byte, 2 * kEventHeaderSize> memory{};
  EventWriter writer(memory);
  ASSERT_TRUE(writer.put({.type = kPose, .source = 1, .hops_left = 5}, {}));
  ASSERT_TRUE(writer.put({.type = kPose, .source = 2, .sequence = 1, .hops_left = 5}, {}));
  first.hub().push(1, writer.bytes(), 0);
  ASSERT_TRUE(at_second.await_deliveries(2));
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "5.2#1");
}

// ev-5.5-1
TEST_F(HubLinks, SurviveARestartOfTheOtherHubAndReportTheGap) {
  ServedHub far;
  ServedHub near;
  link(near, far);
  Recorder reports;
  const auto listener = make_consumer(node_, near, reports, of_type(kLinkType));
  const auto consumer = make_consumer(node_, near, recorder_, of_type(kPose));
  await_interest(near, 2);
  far.stop();
  ASSERT_TRUE(await([&] { return near.hub().links()[0].state == LinkState::kInterrupted; }));
  EXPECT_FALSE(near.hub().links()[0].reason.empty());
  far.start();
  await_interest(near, 2);
  const LinkStatus status = near.hub().links()[0];
  EXPECT_EQ(status.interruption_count, 1U);
  EXPECT_GT(status.last_gap, 0ns);
  EXPECT_EQ(status.peer_epoch, far.hub().epoch());
  ASSERT_TRUE(reports.await([](const Recorder& it) {
    const auto report = read_link_report(it.last_payload_);
    return report && report->state == LinkState::kLinked && report->has_peer_restarted &&
           report->gap > 0ns;
  }));
  const auto supplier = supply(far, 1);
  push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.texts_.back(), "") << "its own subscription was not touched";
}

TEST_F(HubLinks, WaitForAHubThatStartsLater) {
  ServedHub far;
  ServedHub near;
  far.stop();
  link(near, far);
  ASSERT_TRUE(
      await([&] { return near.hub().links()[0].reason.find("127.0.0.1") != std::string::npos; }));
  EXPECT_EQ(near.hub().links()[0].state, LinkState::kConnecting);
  const auto consumer = make_consumer(node_, near, recorder_, of_type(kPose));
  far.start();
  await_interest(near, 1);
}

// ev-5.2-5
TEST_F(HubLinks, RefuseALinkToTheSameHub) {
  ServedHub hub;
  link(hub, hub);
  ASSERT_TRUE(await([&] { return hub.hub().links()[0].state == LinkState::kRefused; }));
  rtpm::test::expect_text(hub.hub().links()[0].reason, {"itself"});
  EXPECT_EQ(hub.hub().subscription_count(), 0U);
}

TEST_F(HubLinks, AreLimitedPerHub) {
  ServedHub hub;
  for (std::size_t i = 0; i < kLinkCountMax; ++i)
    ASSERT_TRUE(hub.hub().link(node_, "rtpm://127.0.0.1:1/rtpm/events", {.deadline = 10ms}));
  const auto refused = hub.hub().link(node_, "rtpm://127.0.0.1:1/rtpm/events", {});
  ASSERT_FALSE(refused);
  rtpm::test::expect_text(refused.error().text(), {"16 links"});
}

// ev-5.4-2: each link has a quota, like a supplier.
TEST_F(HubLinks, KeepToTheQuota) {
  ServedHub far;
  ServedHub near({.quota = {.events_per_s = 100, .bytes_per_s = 1e6, .burst_s = 0.1}});
  link(near, far);
  const auto consumer = make_consumer(node_, near, recorder_, of_type(kPose));
  await_interest(near, 1);
  const auto supplier = supply(far, 1);
  for (int i = 0; i < 1000; ++i)
    push(*supplier, kPose);
  EXPECT_TRUE(await([&] { return near.hub().links()[0].refused_count > 500; }));
  EXPECT_LT(near.hub().links()[0].taken_count, 500U);
}

// ev-5.1-1
TEST_F(HubLinks, DistinguishSuppliersByTag) {
  ServedHub far;
  ServedHub near;
  link(near, far);
  const auto consumer = make_consumer(node_, near, recorder_, of_type(kPose));
  await_interest(near, 1);
  std::vector<std::uint32_t> tags;
  for (const ServedHub* hub : {&far, &far, &near}) {
    const auto supplier = supply(*hub, 1);
    for (int i = 0; i < 2; ++i) {
      push(*supplier, kPose);
      ASSERT_TRUE(recorder_.await_deliveries(tags.size() + 1));
      ASSERT_TRUE(recorder_.await([&](const Recorder& it) {
        tags.push_back(it.last_header_.supplier_tag);
        return true;
      }));
    }
  }
  EXPECT_EQ(tags[0], tags[1]);
  EXPECT_EQ(tags[2], tags[3]);
  EXPECT_EQ(tags[4], tags[5]);
  EXPECT_NE(tags[0], 0U);
  EXPECT_NE(tags[0], tags[2]);
  EXPECT_NE(tags[2], tags[4]);
}

// ev-5.5-2
TEST(LinkReport, RejectsMalformedPayloads) {
  std::array<std::byte, kLinkReportSize> bytes{};
  EXPECT_TRUE(read_link_report(bytes));
  EXPECT_FALSE(read_link_report(ConstBytes(bytes).first(kLinkReportSize - 1)));
  bytes[0] = std::byte{4};
  EXPECT_FALSE(read_link_report(bytes));
  bytes[0] = std::byte{3};
  EXPECT_EQ(read_link_report(bytes)->state, LinkState::kRefused);
  bytes[1] = std::byte{2};
  EXPECT_FALSE(read_link_report(bytes));
}

}  // namespace
}  // namespace rtpm::events::test
