#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "../programs.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"

#include <events.rtpm.hpp>

// Names and texts of other programs on our programs' terminals: they do not control a terminal,
// forge a line or flood a log.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kForged = "rtpm-eventd: all is well";
/// Clears the screen, sets the title, forges a line, and is not valid UTF-8.
const std::string kHostile =
    "\x1b[2J\x1b]0;owned\x07\n" + std::string(kForged) + "\r\xff\xc2\x9b" + "31m";

/// Whether a text has only lines of printable characters, none of them forged.
void expect_harmless(std::string_view text) {
  for (const char each : text)
    EXPECT_TRUE(each == '\n' || each == '\t' ||
                (static_cast<unsigned char>(each) >= 0x20 && each != '\x7f'))
        << static_cast<int>(each) << " in: " << text;
  EXPECT_EQ(text.find("\xc2\x9b"), std::string_view::npos);
  EXPECT_EQ(text.find("\xff"), std::string_view::npos);
  EXPECT_FALSE(text.starts_with(kForged));
  EXPECT_EQ(text.find("\n" + std::string(kForged)), std::string_view::npos) << text;
}

class ForeignNames : public testing::Test {
 protected:
  void SetUp() override {
    hub_ = start_daemon("rtpm-eventd", {"--port", "0", "--name", "", "--realtime", "off"});
    ASSERT_TRUE(hub_);
    auto client = events::HubClient::bind(node_, hub_->url, {.deadline = kPatience});
    ASSERT_TRUE(client) << client.error().text();
    client_ = std::make_unique<events::HubClient>(std::move(*client));
  }
  /// Subscribes by that name, and disconnects.
  void come_and_go(const std::string& name) {
    events::SubscribeRequestT request;
    request.name = name;
    request.filter = std::make_unique<events::FilterNodeT>();
    request.filter->kind = events::NodeKind::Everything;
    request.delivery = std::make_unique<events::DeliveryEntryT>();
    auto stream = client_->subscribe(request);
    ASSERT_TRUE(stream);
    const auto first = stream->next(rt::now() + kPatience);
    ASSERT_TRUE(first);
    ASSERT_TRUE((*first)->refusal() == nullptr) << (*first)->refusal()->str();
  }

  std::optional<Daemon> hub_{};
  rpc::Node node_{};
  std::unique_ptr<events::HubClient> client_{};
};

TEST_F(ForeignNames, AreEscapedByTheHub) {
  come_and_go(kHostile);
  EXPECT_TRUE(hub_->process.wait_for_errors("was dropped: it is gone\n", kPatience))
      << hub_->process.errors();
  come_and_go(std::string(1000, 'x'));
  EXPECT_TRUE(hub_->process.wait_for_errors("xxx…' was dropped: it is gone\n", kPatience))
      << hub_->process.errors();
  expect_harmless(hub_->process.errors());
  expect_text(hub_->process.errors(), {"consumer '\\x1b[2J\\x1b]0;owned\\x07\\nrtpm-eventd"});
  EXPECT_LT(hub_->process.errors().size(), 2000U);
  const auto report = client_->report();
  ASSERT_TRUE(report);
  for (const auto* each : *(*report)->disconnects())
    expect_harmless(each->name()->string_view());
}

TEST_F(ForeignNames, DoNotFloodTheHubsLog) {
  constexpr int kCount = 400;
  const MonotonicTime begin = rt::now();
  for (int i = 0; i < kCount && !HasFailure(); ++i) {
    come_and_go("flooder" + std::to_string(i));
    // Lets the hub check between two of them, as it does four times a second.
    if (i % 40 == 39) std::this_thread::sleep_for(300ms);
  }
  EXPECT_TRUE(hub_->process.wait_for_errors("more suppressed\n", kPatience))
      << hub_->process.errors();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(rt::now() - begin).count();
  EXPECT_LE(test::line_count(hub_->process.errors()), 20 + seconds + 2) << hub_->process.errors();
}

/// An object whose texts are all hostile.
class HostileServant final : public rpc::Servant {
 public:
  const rpc::InterfaceDescriptor& interface() const noexcept override { return interface_; }
  rpc::DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                               const rpc::CallContext&) override {
    return {};
  }

 private:
  const std::string schema_ = "// " + kHostile + "\ntable " + kHostile + " {";
  const rpc::InterfaceDescriptor interface_{.name = kHostile,
                                            .fingerprint = 1,
                                            .compiler_version = kHostile,
                                            .methods = {},
                                            .schema = schema_};
};

class ForeignObjects : public testing::Test {
 protected:
  void SetUp() override {
    rpc::ServerConfig config;
    config.realtime = rt::RealtimeMode::kOff;
    auto server = rpc::Server::create(config);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    catalog_.add(kHostile, servant_);
    catalog_.add("object", servant_);
    ASSERT_TRUE(server_->add(introspection::kPath, catalog_));
    ASSERT_TRUE(server_->add("object", servant_));
    ASSERT_TRUE(server_->start());
  }
  void TearDown() override {
    if (server_) server_->stop();
  }

  HostileServant servant_;
  introspection::Catalog catalog_;
  std::unique_ptr<rpc::Server> server_;
};

TEST_F(ForeignObjects, AreListedInOneLineEach) {
  const auto end = run_program("rtpm", {"list", server_->url("object")});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 2) << end.output;
  expect_harmless(end.output);
}

TEST_F(ForeignObjects, AreRefusedInOneSentence) {
  for (const char* const verb : {"info", "call"}) {
    std::vector<std::string> arguments{verb, server_->url("object")};
    if (arguments[0] == "call") arguments.emplace_back("method");
    const auto end = run_program("rtpm", arguments);
    expect_one_sentence(end, 3, {"rtpm: "});
    expect_harmless(end.errors);
  }
}

TEST_F(ForeignObjects, AreNamedHarmlesslyInErrorsOfTheLibrary) {
  rpc::Node node;
  const auto bound = events::HubClient::bind(node, server_->url("object"));
  ASSERT_FALSE(bound);
  expect_harmless(bound.error().text());
  EXPECT_NE(bound.error().text().find("\\x1b[2J"), std::string::npos) << bound.error().text();
}

}  // namespace
}  // namespace rtpm::system_test
