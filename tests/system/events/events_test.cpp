#include <gtest/gtest.h>
#include <signal.h>

#include <string>

#include "../programs.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/process.hpp"

#include <events.rtpm.hpp>

// A hub, suppliers and consumers as processes, of which some stop or die. Both ways of delivery: by
// a consumer's own stream, and by the ring that all consumers on the hub's host share.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;
using namespace std::string_literals;

class Events : public WithRegistry, public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    hub_ = start_server("rtpm-eventd");
    ASSERT_TRUE(hub_);
    supplier_.emplace(std::vector{path_of("events-peer"), "supply"s, registry_->url, kHub});
    ASSERT_TRUE(supplier_->wait_for_output("supplying\n", kPatience)) << supplier_->errors();
  }

  /// A consumer that has received its first event.
  [[nodiscard]] test::Process start_consumer(const std::string& hub = kHub) const {
    test::Process consumer({path_of("events-peer"), "consume", registry_->url, hub, GetParam()});
    EXPECT_TRUE(consumer.wait_for_output("event ", kPatience))
        << consumer.output() << consumer.errors();
    return consumer;
  }
  /// Waits until it receives `count` more events.
  static void expect_events(test::Process& consumer, int count) {
    const std::size_t begin = consumer.output().size();
    const MonotonicTime give_up = rt::now() + kPatience;
    int seen = 0;
    while (seen < count && rt::now() < give_up) {
      static_cast<void>(consumer.wait_for_output("nothing that it prints", 10ms));
      seen = test::line_count(std::string_view(consumer.output()).substr(begin));
    }
    EXPECT_GE(seen, count) << consumer.errors();
  }
  /// The sequences that a consumer printed, which must be without a gap.
  static void expect_no_gap(const test::Process& consumer) {
    std::uint64_t last = 0;
    const std::string& text = consumer.output();
    for (std::size_t at = text.find("event "); at != std::string::npos;
         at = text.find("event ", at + 1)) {
      // The last line may be incomplete.
      if (text.find('\n', at) == std::string::npos) break;
      const std::uint64_t sequence = std::stoull(text.substr(at + 6));
      EXPECT_TRUE(last == 0 || sequence == last + 1) << last << " then " << sequence;
      last = sequence;
    }
    EXPECT_GT(last, 0U);
  }
  [[nodiscard]] std::size_t subscription_count() const {
    rpc::Node node;
    auto hub = events::HubClient::bind(node, hub_->url);
    EXPECT_TRUE(hub);
    if (!hub) return 0;
    const auto report = hub->report();
    EXPECT_TRUE(report);
    return report ? (*report)->subscriptions()->size() : 0;
  }

  static inline const std::string kHub{events::kHubPath};
  std::optional<Daemon> hub_{};
  std::optional<test::Process> supplier_{};
};

TEST_P(Events, StoppedConsumerCostsNoOtherAnEventAndComesBack) {
  test::Process stopped = start_consumer();
  test::Process other = start_consumer();
  stopped.send_signal(SIGSTOP);
  expect_events(other, 4000);
  expect_no_gap(other);
  EXPECT_TRUE(hub_->process.wait_for_errors("was dropped: it missed too many", kPatience))
      << hub_->process.errors();
  stopped.send_signal(SIGCONT);
  // The consumer was away for longer than a stream is kept: it subscribes again by itself.
  EXPECT_TRUE(stopped.wait_for_output("resubscribed\n", kPatience)) << stopped.output();
  expect_events(stopped, 10);
}

TEST_P(Events, KilledConsumerFreesItsSlotAndDisturbsNoOther) {
  test::Process other = start_consumer();
  {
    test::Process killed = start_consumer();
    EXPECT_EQ(subscription_count(), 2U);
    killed.send_signal(SIGKILL);
    EXPECT_TRUE(killed.wait(kPatience));
  }
  const MonotonicTime give_up = rt::now() + kPatience;
  while (subscription_count() > 1 && rt::now() < give_up)
    expect_events(other, 10);
  EXPECT_EQ(subscription_count(), 1U);
  EXPECT_TRUE(hub_->process.wait_for_errors("was dropped: it is gone", kPatience))
      << hub_->process.errors();
  expect_no_gap(other);
}

TEST_P(Events, KilledHubIsReplacedAndAllGoOnByThemselves) {
  test::Process consumer = start_consumer();
  const std::string port = std::to_string(hub_->port());
  hub_->process.send_signal(SIGKILL);
  EXPECT_TRUE(hub_->process.wait(kPatience));
  EXPECT_TRUE(consumer.wait_for_output("interrupted", kPatience)) << consumer.output();
  hub_ = start_server("rtpm-eventd", {"--port", port});
  ASSERT_TRUE(hub_);
  EXPECT_TRUE(consumer.wait_for_output("resubscribed to another life\n", kPatience))
      << consumer.output();
  expect_events(consumer, 20);
}

TEST_P(Events, KilledSupplierIsReplaced) {
  test::Process consumer = start_consumer();
  supplier_->send_signal(SIGKILL);
  supplier_.emplace(std::vector{path_of("events-peer"), "supply"s, registry_->url, kHub});
  ASSERT_TRUE(supplier_->wait_for_output("supplying\n", kPatience));
  expect_events(consumer, 100);
}

INSTANTIATE_TEST_SUITE_P(Deliveries, Events, testing::Values("stream", "ring"),
                         [](const auto& each) { return std::string(each.param); });

/// A second hub that gets its own consumers' events from the first, which has the supplier.
class LinkedEvents : public Events {
 protected:
  void SetUp() override {
    Events::SetUp();
    linked_ = start_server("rtpm-eventd", {"--name", kLinkedName, "--link", kHub});
    ASSERT_TRUE(linked_);
  }
  static inline const std::string kLinkedName = "rtpm/linked-events";
  std::optional<Daemon> linked_{};
};

// ev-5.4-1
TEST_P(LinkedEvents, StoppedLinkedHubCostsNoOtherAnEventAndComesBack) {
  test::Process behind_link = start_consumer(kLinkedName);
  test::Process local = start_consumer();
  linked_->process.send_signal(SIGSTOP);
  expect_events(local, 4000);
  expect_no_gap(local);
  linked_->process.send_signal(SIGCONT);
  expect_events(behind_link, 10);
}

// ev-5.4-1
TEST_P(LinkedEvents, StoppedSourceHubCostsNoOtherAnEvent) {
  test::Process supplier({path_of("events-peer"), "supply", registry_->url, kLinkedName});
  ASSERT_TRUE(supplier.wait_for_output("supplying\n", kPatience)) << supplier.errors();
  supplier_->send_signal(SIGKILL);
  EXPECT_TRUE(supplier_->wait(kPatience));
  test::Process local = start_consumer(kLinkedName);
  hub_->process.send_signal(SIGSTOP);
  expect_events(local, 4000);
  hub_->process.send_signal(SIGCONT);
}

TEST_P(LinkedEvents, KilledHubIsReplacedAndTheLinkIsMadeAnew) {
  test::Process behind_link = start_consumer(kLinkedName);
  const std::string port = std::to_string(hub_->port());
  hub_->process.send_signal(SIGKILL);
  EXPECT_TRUE(hub_->process.wait(kPatience));
  hub_ = start_server("rtpm-eventd", {"--port", port});
  ASSERT_TRUE(hub_);
  expect_events(behind_link, 20);
}

INSTANTIATE_TEST_SUITE_P(Deliveries, LinkedEvents, testing::Values("ring"),
                         [](const auto& each) { return std::string(each.param); });

TEST(EventsDaemon, ReportsErrorsInOneSentence) {
  const auto end = run_program("rtpm-eventd", {"--registry", "rtpm://127.0.0.1:1/rtpm/names",
                                               "--port", "0", "--realtime", "off"});
  expect_one_sentence(end, 1, {"rtpm-eventd", "127.0.0.1:1"});
}

}  // namespace
}  // namespace rtpm::system_test
