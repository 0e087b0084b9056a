#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <touch.rtpm.events.hpp>
#include <vector>

#include "fixture.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/events/trials.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/test/os.hpp"

// The promises of rtpm-console to a page, with real daemons.
namespace rtpm::system_test {
namespace {

class Consoles : public ConsoleSystem {};

/// The process id of the program that this test has started.
std::string child_named(const std::string& name) {
  std::ifstream children("/proc/thread-self/children");
  for (std::string id; children >> id;) {
    std::string command;
    std::ifstream("/proc/" + id + "/comm") >> command;
    if (command == name) return id;
  }
  ADD_FAILURE() << name << " is no child";
  return "self";
}

TEST_F(Consoles, DescribeThemselvesAndTheSystem) {
  const auto client = connect();
  ASSERT_TRUE(client->web().is_accepted()) << client->web().answer();
  EXPECT_NE(client->web().answer().find("Sec-WebSocket-Protocol: foxglove.sdk.v1"),
            std::string::npos);
  ASSERT_TRUE(client->await_channel("lab/arm0/sample"));
  EXPECT_EQ(client->info()["metadata"]["rtpm.access"], "command");
  EXPECT_EQ(client->channels().at("lab/arm0/sample")["schemaName"], "rtpm.device.Sampled");
  EXPECT_EQ(client->channels().at("lab/arm0/sample")["encoding"], "flatbuffer");
  EXPECT_TRUE(client->await_service("lab/arm0/read"));
  EXPECT_TRUE(client->await_service("lab/arm0/config/list"));
  EXPECT_TRUE(client->await_service("console/estop"));

  client->subscribe("console/state");
  const Json state = client->await_state([](const Json& one) {
    return is_live(one, "lab/arm0") && one["hub"]["ok"] == true &&
           device_in(one, "lab/arm0")["sample_per_s"].get<double>() > 0;
  });
  EXPECT_EQ(state["registry"]["ok"], true);
  const Json device = device_in(state, "lab/arm0");
  EXPECT_EQ(device["class"], "haptic");
  EXPECT_EQ(device["model"], "RTPM simulated arm");
  EXPECT_EQ(device["lifecycle"], "active");
  EXPECT_EQ(device["axes"].size(), 3u);
  EXPECT_EQ(device["has_config"], true);
  EXPECT_EQ(state["clients"]["count"], 1);
  EXPECT_FALSE(state["servers"].empty());
}

TEST_F(Consoles, AnswerPagesAndHealth) {
  std::ofstream(folder_ + "/page/index.html") << "<html>";
  const std::string page = http(console_->port, "GET / HTTP/1.1", "");
  EXPECT_EQ(status_of(page), "200");
  expect_text(page, {"Content-Type: text/html", "Cache-Control: no-store",
                     "Content-Security-Policy: default-src 'self'"});
  EXPECT_TRUE(page.ends_with("<html>"));
  EXPECT_NE(http(console_->port, "GET /health HTTP/1.1", "").find(R"({"status":"ok"})"),
            std::string::npos);
  EXPECT_FALSE(http(console_->port, "HEAD / HTTP/1.1", "").ends_with("<html>"));
}

// Both encodings carry the same numbers, and those of another client.
TEST_F(Consoles, EncodeSamplesAndRepliesByTheAdvertisedSchema) {
  const auto client = connect();
  client->subscribe("lab/arm0/sample");
  const auto first = client->next_message("lab/arm0/sample");
  const auto second = client->next_message("lab/arm0/sample");
  EXPECT_GT(second.log_time_ns, first.log_time_ns);
  // Calls with the encoding flatbuffer, as Foxglove would.
  const auto reply = client->call_bytes("lab/arm0/read", "");
  ASSERT_TRUE(reply);
  EXPECT_GT(reply->size(), 400u);

  const Json by_console = client->call("lab/arm0/describe", Json::object());
  const auto by_tool = rtpm({"call", "lab/arm0", "describe"});
  EXPECT_EQ(by_console, Json::parse(by_tool.output, nullptr, false));
  EXPECT_EQ(client->call("lab/arm0/renew", {{"lease", 0}}), Json({{"code", "NotHolder"}}));
  // The list has unbounded ranges, for which JSON has no number.
  EXPECT_GE(client->call("lab/arm0/config/list", Json::object())["parameters"].size(), 9u);
}

TEST_F(Consoles, RefuseCallsThatDoNotFit) {
  const auto client = connect();
  EXPECT_NE(client->call("lab/arm0/read", {{"x", 1}})["failure"].get<std::string>().find("schema"),
            std::string::npos);
  EXPECT_NE(client->call("console/take_over", {{"device", "lab/none"}})
                .value("failure", "")
                .find("there is no device 'lab/none'"),
            std::string::npos);
  EXPECT_TRUE(client->call("console/replay_play", Json::object()).contains("failure"));
  EXPECT_TRUE(client->call("console/replay_open", {{"file", "../x.mcap"}}).contains("failure"));
  EXPECT_TRUE(client->call("console/replay_seek", {{"time_ns", "x"}}).contains("failure"));
}

TEST_F(Consoles, StopDevicesAndArmThemAgain) {
  const auto client = connect_to_arm();
  client->subscribe("lab/arm0/event");
  const Json stopped = client->call("console/estop", Json::object());
  EXPECT_EQ(stopped["stopped"], Json::array({"lab/arm0"}));
  EXPECT_TRUE(stopped["failed"].empty()) << stopped;
  const Json event = client->await_message(
      "lab/arm0/event", [](const Json& one) { return one["type"] == "rtpm.device.StopChanged"; });
  EXPECT_EQ(event["payload"]["is_stopped"], true);
  EXPECT_EQ(event["device"], "lab/arm0");
  static_cast<void>(client->await_state(
      [](const Json& state) { return device_in(state, "lab/arm0")["is_stopped"] == true; }));

  EXPECT_EQ(client->call("console/rearm", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  static_cast<void>(client->await_state([](const Json& state) {
    const Json device = device_in(state, "lab/arm0");
    return device["is_stopped"] == false && device["lease"]["state"] == "held by this console";
  }));
  EXPECT_EQ(client->call("lab/arm0/renew", {{"lease", 0}}), Json({{"code", "Done"}}));
  EXPECT_EQ(client->call("console/release", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  static_cast<void>(client->await_state(
      [](const Json& state) { return device_in(state, "lab/arm0")["lease"]["state"] == "free"; }));
}

// A duplicate name at another registry does not prevent a stop.
TEST_F(Consoles, StopEveryOtherServerAtTheRegistry) {
  const auto client = connect_to_arm();
  // The name leads to a server that does not answer.
  ASSERT_EQ(rtpm({"bind", "lab/ghost", "rtpm://127.0.0.1:1/lab/ghost", "--interface",
                  "rtpm.device.Device"})
                .exit_code,
            0);
  const Json stopped = client->call("console/estop", Json::object());
  EXPECT_EQ(stopped["stopped"], Json::array({"lab/arm0"})) << stopped;
  ASSERT_EQ(stopped["failed"].size(), 1u) << stopped;
  EXPECT_EQ(stopped["failed"][0]["device"], "lab/ghost");
  EXPECT_EQ(stopped["hub_count"], 1);
  EXPECT_EQ(client->call("console/estop", {{"device", 3}}).contains("failure"), true);
}

// A device server hangs until its names have expired: then it is lost, the stop is pending, and is
// executed when the server goes on.
TEST_F(Consoles, DeliverAStopToADeviceThatHung) {
  const auto client = connect_to_arm();
  devices_->process.send_signal(SIGSTOP);
  const Json lost = client->await_state([](const Json& state) {
    const Json device = device_in(state, "lab/arm0");
    return device.is_object() && device["lost_for_s"].is_number();
  });
  EXPECT_EQ(device_in(lost, "lab/arm0")["ok"], false);
  const auto listed = rtpm({"list"});
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_NE(listed.output.find("LOST for"), std::string::npos) << listed.output;

  const Json stopped = client->call("console/estop", Json::object());
  EXPECT_TRUE(stopped["stopped"].empty()) << stopped;
  ASSERT_EQ(stopped["failed"].size(), 1u) << stopped;
  const Json owed =
      client->await_state([](const Json& state) { return !state["not_stopped"].empty(); });
  EXPECT_EQ(owed["not_stopped"][0]["device"], "lab/arm0");
  EXPECT_FALSE(owed["not_stopped"][0]["why"].get<std::string>().empty());

  devices_->process.send_signal(SIGCONT);
  const Json back = client->await_state([](const Json& state) {
    return state["not_stopped"].empty() && device_in(state, "lab/arm0")["is_stopped"] == true;
  });
  static_cast<void>(client->await_state([](const Json& state) {
    return is_live(state, "lab/arm0") && device_in(state, "lab/arm0")["lost_for_s"].is_null();
  }));
}

TEST_F(Consoles, ListADeadDeviceAsLostUntilItIsDismissed) {
  const auto client = connect_to_arm();
  devices_->process.send_signal(SIGKILL);
  const auto is_lost = [](const Json& state) {
    const Json device = device_in(state, "lab/arm0");
    return device.is_object() && device["lost_for_s"].is_number();
  };
  static_cast<void>(client->await_state(is_lost));
  // Another console has never seen the device.
  auto second = start_console(console_arguments());
  ASSERT_TRUE(second);
  ConsoleClient other(second->port, second->target);
  other.subscribe("console/state");
  static_cast<void>(other.await_state(is_lost));
  EXPECT_FALSE(client->call("console/estop", Json::object())["failed"].empty());
  EXPECT_TRUE(client->call("console/dismiss", {{"device", "lab/none"}}).contains("failure"));
  EXPECT_EQ(client->call("console/dismiss", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  static_cast<void>(client->await_state(
      [](const Json& state) { return state["devices"].empty() && state["not_stopped"].empty(); }));
  EXPECT_TRUE(test::await(
      [&] { return rtpm({"list"}).output.find("lab/arm0") == std::string::npos; }, kPatience))
      << "the registry's record ends, too";
}

TEST_F(Consoles, RemoveADeviceThatEndedInOrder) {
  const auto client = connect_to_arm();
  devices_->process.send_signal(SIGTERM);
  ASSERT_TRUE(devices_->process.wait(kPatience));
  const Json state =
      client->await_state([](const Json& one) { return device_in(one, "lab/arm0").is_null(); });
  EXPECT_TRUE(state["not_stopped"].empty());
}

TEST_F(Consoles, LetOneBrowserOperateADeviceAtATime) {
  const auto first = connect_to_arm();
  const auto second = connect();
  ASSERT_EQ(first->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  const std::string why =
      second->call("console/deactivate", {{"device", "lab/arm0"}}).value("failure", "");
  EXPECT_NE(why.find("another browser (connection "), std::string::npos) << why;
  EXPECT_TRUE(second->call("lab/arm0/recover", {{"lease", 0}}).contains("failure"));
  // Every client may stop a device.
  EXPECT_EQ(second->call("console/estop", {{"device", "lab/arm0"}})["stopped"],
            Json::array({"lab/arm0"}));
  EXPECT_EQ(second->call("console/rearm", {{"device", "lab/arm0"}, {"force", true}}),
            Json({{"ok", true}}));
  EXPECT_TRUE(first->call("console/release", {{"device", "lab/arm0"}}).contains("failure"));
}

TEST_F(Consoles, KeepALeaseOverAReloadOfThePage) {
  {
    const auto before = connect_to_arm();
    ASSERT_EQ(before->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  }
  const auto again = connect();
  again->subscribe("console/state");
  static_cast<void>(again->await_state([](const Json& state) {
    const Json lease = device_in(state, "lab/arm0")["lease"];
    return state["clients"]["count"] == 1 && lease["state"] == "held by this console" &&
           lease["ends_in_s"].is_null();
  }));
  EXPECT_EQ(again->call("console/release", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
}

TEST_F(Consoles, ReleaseTheLeaseOfASilentBrowserAfterFiveSeconds) {
  const auto watcher = connect_to_arm();
  const auto is_held = [](const Json& state) {
    return device_in(state, "lab/arm0")["lease"]["state"] == "held by this console";
  };
  // From now on the client does not answer pings, and its connection stays open.
  const auto silent = connect();
  ASSERT_EQ(silent->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  static_cast<void>(watcher->await_state(is_held));
  int count = 0;
  static_cast<void>(watcher->await_state([&](const Json& state) {
    ++count;
    return !is_held(state) && state["clients"]["count"] == 1;
  }));
  // The console publishes four states per second.
  EXPECT_LT(count, 32);
}

TEST_F(Consoles, ReleaseTheLeaseOfADisconnectedBrowserAfterFiveSeconds) {
  const auto watcher = connect_to_arm();
  {
    const auto leaving = connect();
    ASSERT_EQ(leaving->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  }
  const Json left = watcher->await_state([](const Json& state) {
    return device_in(state, "lab/arm0")["lease"]["ends_in_s"].is_number();
  });
  EXPECT_LE(device_in(left, "lab/arm0")["lease"]["ends_in_s"], 5.0);
  static_cast<void>(watcher->await_state([](const Json& state) {
    return device_in(state, "lab/arm0")["lease"]["state"] != "held by this console" &&
           state["clients"]["count"] == 1;
  }));
  // No client operates it, so `force` is not needed.
  EXPECT_EQ(watcher->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
}

TEST_F(Consoles, WaitForADeviceThatGrantsOneTakeOverASecond) {
  const auto first = connect_to_arm();
  const auto second = connect();
  ASSERT_EQ(first->call("console/take_over", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  EXPECT_EQ(second->call("console/take_over", {{"device", "lab/arm0"}, {"force", true}}),
            Json({{"ok", true}}));
}

TEST_F(Consoles, ReadChangeAndWatchParameters) {
  const auto client = connect();
  const auto watcher = connect();
  const std::string ramp = "lab/arm0.safety.ramp_s";
  ASSERT_TRUE(client->await_service("lab/arm0/config/apply"));
  watcher->send({{"op", "subscribeParameterUpdates"}, {"parameterNames", {ramp}}});
  watcher->send({{"op", "getParameters"}, {"parameterNames", {ramp}}, {"id", "w"}});
  ASSERT_EQ(watcher->await_parameters("w").size(), 1u);

  client->send({{"op", "getParameters"}, {"parameterNames", Json::array()}, {"id", "all"}});
  EXPECT_GE(client->await_parameters("all").size(), 9u);
  client->send({{"op", "setParameters"},
                {"parameters", Json::array({{{"name", ramp}, {"value", 0.012}}})},
                {"id", "set"}});
  EXPECT_EQ(client->await_parameters("set")[ramp], 0.012);
  EXPECT_EQ(watcher->await_parameters("")[ramp], 0.012);
  EXPECT_NE(rtpm({"config", "get", "lab/arm0", "safety.ramp_s"}).output.find("0.012"),
            std::string::npos);

  client->send({{"op", "setParameters"},
                {"parameters", Json::array({{{"name", ramp}, {"value", 1e9}}})},
                {"id", "bad"}});
  EXPECT_EQ(client->await_parameters("bad")[ramp], 0.012);
  ASSERT_FALSE(client->statuses().empty());
  EXPECT_EQ(client->statuses().back()["level"], 2);
  EXPECT_NE(client->statuses().back()["message"].get<std::string>().find("out of range"),
            std::string::npos);

  // Changes by another program are reported, too.
  EXPECT_EQ(rtpm({"config", "set", "lab/arm0", "safety.ramp_s=0.015"}).exit_code, 0);
  EXPECT_EQ(watcher->await_parameters("")[ramp], 0.015);
}

TEST_F(Consoles, GiveReadOnlyAccessWithoutTheToken) {
  for (const std::string target : {"/", "/?token=0123456789abcdef"}) {
    ConsoleClient observer(console_->port, target);
    ASSERT_TRUE(observer.web().is_accepted());
    ASSERT_TRUE(observer.await_channel("lab/arm0/sample"));
    EXPECT_EQ(observer.info()["metadata"]["rtpm.access"], "observe");
    EXPECT_EQ(std::ranges::count(observer.info()["capabilities"], "services"), 0);
    EXPECT_TRUE(observer.services().empty());
    // The client guesses ids.
    for (char id = 1; id < 30; ++id)
      observer.web().send_binary(std::string("\x02", 1) + id + std::string(3, '\0') + id +
                                 std::string("\0\0\0\4\0\0\0json{}", 13));
    observer.send(
        {{"op", "setParameters"},
         {"parameters", Json::array({{{"name", "lab/arm0.safety.ramp_s"}, {"value", 0.013}}})},
         {"id", "no"}});
    EXPECT_NE(observer.await_parameters("no")["lab/arm0.safety.ramp_s"], 0.013);
    bool is_told = false;
    for (const Json& status : observer.statuses())
      is_told =
          is_told || status["message"].get<std::string>().starts_with("read-only: open the URL");
    EXPECT_TRUE(is_told);
    observer.subscribe("console/state");
    const Json state =
        observer.await_state([](const Json& one) { return is_live(one, "lab/arm0"); });
    EXPECT_EQ(device_in(state, "lab/arm0")["is_stopped"], false);
  }
}

TEST_F(Consoles, RefuseEveryCommandWhenReadOnly) {
  auto arguments = console_arguments();
  arguments.emplace_back("--read-only");
  const auto console = start_console(arguments);
  ASSERT_TRUE(console);
  EXPECT_EQ(console->target, "/");
  ConsoleClient client(console->port, "/");
  ASSERT_TRUE(client.await_channel("console/state"));
  EXPECT_EQ(client.info()["metadata"]["rtpm.access"], "observe");
  client.send(
      {{"op", "setParameters"},
       {"parameters", Json::array({{{"name", "lab/arm0.safety.ramp_s"}, {"value", 0.013}}})},
       {"id", "no"}});
  static_cast<void>(client.await_parameters("no"));
  ASSERT_FALSE(client.statuses().empty());
  EXPECT_NE(client.statuses().back()["message"].get<std::string>().find("--read-only"),
            std::string::npos);
}

TEST_F(Consoles, ShowTheLogOfAFilter) {
  const auto client = connect();
  const auto other = connect();
  client->subscribe("console/log");
  other->subscribe("console/log");
  ASSERT_TRUE(client->await_channel("lab/arm0/sample"));
  const Json bad = client->call("console/log_filter", {{"filter", "type(rtpm.device.StopChangd)"}});
  EXPECT_EQ(bad["ok"], false);
  EXPECT_EQ(bad["offset"], 5);
  EXPECT_NE(bad["what"].get<std::string>().find("rtpm.device.StopChanged"), std::string::npos);
  const Json good = client->call("console/log_filter", {{"filter", "type(rtpm.device.Sampled)"}});
  EXPECT_EQ(good, Json({{"ok", true}}));
  Json line = client->next_message("console/log").json();
  EXPECT_EQ(line["type"], "rtpm.device.Sampled");
  EXPECT_EQ(line["device"], "lab/arm0");
  EXPECT_TRUE(line["payload"].contains("position_m")) << line;
  // A kilohertz is above the shown rate, and the console reports that.
  line =
      client->await_message("console/log", [](const Json& one) { return one.contains("omitted"); });
  EXPECT_GT(line["omitted"], 0);
  EXPECT_EQ(client->call("console/log_filter", {{"filter", nullptr}}), Json({{"ok", true}}));
}

TEST_F(Consoles, RecordAndPlayRecordings) {
  const auto client = connect();
  client->subscribe("console/state");
  ASSERT_TRUE(client->await_channel("lab/arm0/sample"));
  ASSERT_EQ(client->call("console/record_start", {{"file", "run.mcap"}}),
            Json({{"file", "run.mcap"}}));
  EXPECT_TRUE(client->call("console/record_start", Json::object()).contains("failure"));
  static_cast<void>(client->await_state([](const Json& state) {
    return state["recording"]["file"] == "run.mcap" && state["recording"]["message_count"] > 3200;
  }));
  const Json ended = client->call("console/record_stop", Json::object());
  EXPECT_GT(ended["message_count"], 300);
  EXPECT_EQ(ended["drop_count"], 0);

  std::filesystem::copy_file(folder_ + "/recordings/run.mcap", folder_ + "/recordings/cut.mcap");
  const auto size = std::filesystem::file_size(folder_ + "/recordings/cut.mcap");
  std::filesystem::resize_file(folder_ + "/recordings/cut.mcap", size * 2 / 3);
  std::ofstream(folder_ + "/recordings/bad.mcap") << "this is no recording";
  const Json list = client->call("console/recordings", Json::object());
  ASSERT_EQ(list["files"].size(), 2u) << list;
  EXPECT_EQ(list["files"][0]["file"], "cut.mcap");
  EXPECT_EQ(list["files"][0]["is_complete"], false);
  EXPECT_EQ(list["files"][1]["is_complete"], true);
  EXPECT_EQ(list["files"][1]["message_count"], ended["message_count"]);

  EXPECT_TRUE(client->call("console/replay_open", {{"file", "bad.mcap"}}).contains("failure"));
  for (const std::string file : {"run.mcap", "cut.mcap"}) {
    const Json opened = client->call("console/replay_open", {{"file", file}});
    ASSERT_FALSE(opened["topics"].empty()) << opened;
    std::string topic;
    for (const Json& one : opened["topics"]) {
      if (one == "lab/arm0/sampled") topic = "replay/lab/arm0/sampled";
    }
    client->subscribe(topic);
    EXPECT_EQ(client->channels().at(topic)["schemaName"], "rtpm.device.Sampled");
    EXPECT_EQ(client->call("console/replay_play", {{"speed", 10}}), Json::object());
    const auto message = client->next_message(topic);
    EXPECT_GE(message.log_time_ns, opened["begin_ns"].get<std::uint64_t>());
    static_cast<void>(client->await_state([&](const Json& state) {
      return state["replay"]["file"] == file && state["replay"]["is_playing"] == false;
    }));
    EXPECT_EQ(client->call("console/replay_seek", {{"time_ns", opened["begin_ns"]}}),
              Json::object());
    // Some messages before a sought time come, too, oldest first, so that plots are not empty.
    EXPECT_EQ(client->call("console/replay_seek", {{"time_ns", opened["end_ns"]}}), Json::object());
    auto last_ns = client->next_message(topic).log_time_ns;
    int risen_count = 0;
    for (int i = 0; i < 1000 && risen_count < 8; ++i) {
      const std::uint64_t time_ns = client->next_message(topic).log_time_ns;
      risen_count = time_ns >= last_ns + 100'000'000 ? risen_count + 1 : 0;
      last_ns = time_ns;
    }
    EXPECT_EQ(risen_count, 8);
    EXPECT_EQ(client->call("console/replay_close", Json::object()), Json::object());
    EXPECT_TRUE(client->read_until([&] { return !client->channels().contains(topic); }));
  }
}

// A source used to have a subscription with memory and a thread of its own.
TEST_F(Consoles, ServeManyEventSourcesWithinLimits) {
  using Event = touch::TouchedEvent;
  const auto client = connect_to_arm();
  const auto count_of = [&](const char* key) {
    std::ifstream status("/proc/" + child_named("rtpm-console") + "/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with(key)) return std::stol(line.substr(std::string(key).size()));
    }
    return 0L;
  };
  const long thread_count = count_of("Threads:");
  const long resident_kb = count_of("VmRSS:");
  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock}});
  names::RegistryResolver resolver(node, registry_->url);
  node.use(resolver);
  const auto supplier = events::Supplier::create(node, std::string(events::kHubPath),
                                                 {.types = {&Event::kDescriptor}});
  ASSERT_TRUE(supplier) << supplier.error().text();
  const std::array<std::byte, sizeof(Event::Payload)> payload{};
  const Json state = client->await_state([&](const Json& one) {
    for (events::SourceId source = 1; source <= 200; ++source)
      static_cast<void>((*supplier)->push({.type = Event::kType,
                                           .source = source,
                                           .schema_id = Event::kSchemaId,
                                           .payload = payload}));
    return one["events"]["channel_count"] == 128 && one["events"]["omitted_count"] > 0;
  });
  EXPECT_EQ(state["events"]["channel_count_max"], 128);
  EXPECT_TRUE(client->await_channel("rtpm.touch.Touched/1"));
  EXPECT_LE(count_of("Threads:"), thread_count + 2);
  EXPECT_LE(count_of("VmRSS:"), resident_kb + 64 * 1024);
  EXPECT_TRUE(is_live(client->await_state([](const Json&) { return true; }), "lab/arm0"));
}

TEST_F(Consoles, ShowTheTrialsOfAnExperiment) {
  const auto client = connect_to_arm();
  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock}});
  names::RegistryResolver resolver(node, registry_->url);
  node.use(resolver);
  auto trials = events::TrialSupplier::create(node, std::string(events::kHubPath), 7);
  ASSERT_TRUE(trials) << trials.error().text();
  static_cast<void>(client->await_state([&](const Json&) {
    EXPECT_TRUE(trials->push({.number = 3, .note = "before"}));
    return client->channels().contains("rtpm.Trial/7");
  }));
  client->subscribe("rtpm.Trial/7");
  ASSERT_TRUE(test::await([&] {
    static_cast<void>(trials->push({.number = 3, .note = "touches the wall"}));
    return client->next_message("rtpm.Trial/7").payload.find("touches the wall") !=
           std::string::npos;
  }));
}

TEST_F(Consoles, ListPublishersAndSubscribers) {
  const auto client = connect();
  client->subscribe("lab/arm0/sample");
  client->send({{"op", "subscribeConnectionGraph"}});
  bool is_published = false;
  bool is_subscribed = false;
  bool is_provided = false;
  for (int i = 0; i < 20 && !(is_published && is_subscribed && is_provided); ++i) {
    const Json update = client->await_op("connectionGraphUpdate");
    for (const Json& topic : update["publishedTopics"])
      is_published = is_published || topic["name"] == "lab/arm0/sample";
    for (const Json& topic : update["subscribedTopics"])
      is_subscribed = is_subscribed || topic["name"] == "lab/arm0/sample";
    for (const Json& service : update["advertisedServices"])
      is_provided = is_provided || service["name"] == "lab/arm0/read";
  }
  EXPECT_TRUE(is_published && is_subscribed && is_provided);
}

TEST_F(Consoles, FindReturnedDevicesAndReportLostOnes) {
  const auto client = connect();
  client->subscribe("console/state");
  client->subscribe("lab/arm0/sample");
  static_cast<void>(client->next_message("lab/arm0/sample"));
  devices_->process.send_signal(SIGKILL);
  static_cast<void>(client->await_state([](const Json& state) {
    const Json device = device_in(state, "lab/arm0");
    return device.is_null() ||
           (device["ok"] == false && !device["problem"].get<std::string>().empty());
  }));
  static_cast<void>(
      client->await_state([](const Json& state) { return state["hub"]["ok"] == false; }));
  devices_ = start_devices();
  ASSERT_TRUE(devices_);
  static_cast<void>(client->await_state(
      [](const Json& state) { return is_live(state, "lab/arm0") && state["hub"]["ok"] == true; }));
  const auto other = connect();
  other->subscribe("lab/arm0/sample");
  const auto sample = other->next_message("lab/arm0/sample");
  EXPECT_GT(other->next_message("lab/arm0/sample").log_time_ns, sample.log_time_ns);
}

TEST_F(Consoles, StayUpWithoutARegistry) {
  const auto client = connect_to_arm();
  registry_->process.send_signal(SIGKILL);
  const Json state =
      client->await_state([](const Json& one) { return one["registry"]["ok"] == false; });
  EXPECT_FALSE(state["registry"]["problem"].get<std::string>().empty());
  // The console's sessions with devices last.
  EXPECT_EQ(is_live(state, "lab/arm0"), true);
  const auto lonely = start_console({"--port", "0", "--registry", "rtpm://127.0.0.1:9/rtpm/names"});
  ASSERT_TRUE(lonely);
  ConsoleClient early(lonely->port, lonely->target);
  early.subscribe("console/state");
  EXPECT_TRUE(
      early.await_state([](const Json& one) { return one["registry"]["ok"] == false; })["devices"]
          .empty());
}

// SIGSTOP makes the worst of all servers: it accepts connections, but answers nothing.
TEST_F(Consoles, AnswerWhileADeviceServerIsStopped) {
  const auto client = connect();
  client->subscribe("console/state");
  ASSERT_TRUE(client->await_service("lab/arm0/config/save"));
  devices_->process.stop();
  const Json failed = client->call("lab/arm0/describe", Json::object());
  EXPECT_TRUE(failed.contains("failure")) << failed;
  EXPECT_NE(failed["failure"], "no answer");
  // After a while its name's lease has ended, too.
  static_cast<void>(client->await_state([](const Json& state) {
    const Json device = device_in(state, "lab/arm0");
    return device.is_null() ||
           (device["ok"] == false && !device["problem"].get<std::string>().empty());
  }));
  EXPECT_EQ(client->call("console/recordings", Json::object())["files"], Json::array());
  devices_->process.send_signal(SIGCONT);
  static_cast<void>(
      client->await_state([](const Json& state) { return is_live(state, "lab/arm0"); }));
}

TEST_F(Consoles, EndInOrder) {
  const auto client = connect();
  ASSERT_TRUE(client->await_channel("console/state"));
  console_->process.send_signal(SIGTERM);
  int close_code = 0;
  while (const auto frame = client->web().next(kPatience)) {
    close_code = frame->close_code();
    if (close_code != 0) break;
  }
  EXPECT_EQ(close_code, 1001);
  const auto end = console_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_EQ(end->errors, "");
}

TEST(ConsoleOptions, AreRefusedWithTheReasonIfUnsafe) {
  expect_one_sentence(run_program("rtpm-console", {"--address", "0.0.0.0"}), 2,
                      {"--address 0.0.0.0", "encrypted", "--insecure-lan"});
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--token", "0123456789abcdef"},
        std::vector<std::string>{"--token=0123456789abcdef"}}) {
    expect_one_sentence(run_program("rtpm-console", arguments), 2,
                        {"--token", "command lines", "RTPM_CONSOLE_TOKEN", "--config"});
  }
  expect_one_sentence(run_program("rtpm-console", {"--token-file", "/nowhere/token"}), 1,
                      {"/nowhere/token", "--token-file"});
  expect_one_sentence(run_program("rtpm-console", {"--address", "300.1.1.1", "--insecure-lan"}), 1,
                      {"300.1.1.1"});
}

TEST(ConsoleOptions, DoNotPrintTheToken) {
  const std::string token = "0123456789abcdef";
  ::setenv("RTPM_CONSOLE_TOKEN", token.c_str(), 1);
  for (const char* flag : {"--dump-config", "--help"}) {
    const auto run = run_program("rtpm-console", {flag});
    EXPECT_EQ(run.exit_code, 0) << run.errors;
    EXPECT_NE(run.output.find("RTPM_CONSOLE_TOKEN"), std::string::npos) << run.output;
    EXPECT_EQ(run.output.find(token), std::string::npos) << run.output;
  }
  ::unsetenv("RTPM_CONSOLE_TOKEN");
}

TEST_F(Consoles, ReportATakenPort) {
  expect_one_sentence(run_program("rtpm-console", {"--port", std::to_string(console_->port)}), 1,
                      {std::to_string(console_->port), "another --port"});
}

// Otherwise the token would be in the log that a supervisor keeps of the output.
TEST_F(Consoles, HideTheTokenFromOutputThatIsNotATerminal) {
  const std::string file = folder_ + "/token";
  std::vector<std::string> arguments = console_arguments();
  arguments.insert(arguments.begin(), path_of("rtpm-console"));
  arguments.insert(arguments.end(), {"--token-file", file});
  test::Process quiet(arguments);
  ASSERT_TRUE(quiet.wait_for_output("http://127.0.0.1:", kPatience)) << quiet.errors();
  ASSERT_TRUE(quiet.wait_for_output(file, kPatience)) << quiet.output();
  std::ifstream stream(file);
  std::string token;
  stream >> token;
  EXPECT_EQ(token.size(), 48u);
  EXPECT_EQ(quiet.output().find(token), std::string::npos) << quiet.output();
  const std::string output = quiet.output();
  const std::size_t at = output.find("127.0.0.1:") + 10;
  ConsoleClient client(static_cast<std::uint16_t>(std::stoi(output.substr(at))),
                       "/?token=" + token);
  ASSERT_TRUE(client.await_channel("console/state"));
  EXPECT_EQ(client.info()["metadata"]["rtpm.access"], "command");
}

TEST_F(Consoles, AreReachedThroughATunnelAndByTheirHostsName) {
  const auto status = [](std::uint16_t port, const std::string& host) {
    return status_of(http(port, "GET /health HTTP/1.1", "Host: " + host + "\r\n"));
  };
  EXPECT_EQ(status(console_->port, "localhost:9000"), "200");
  const std::string refused = http(console_->port, "GET / HTTP/1.1", "Host: robot.lab:8765\r\n");
  EXPECT_EQ(status_of(refused), "403");
  expect_text(refused, {"'robot.lab:8765'", "--host-name"});
  auto arguments = console_arguments();
  arguments.insert(arguments.end(),
                   {"--address", "0.0.0.0", "--insecure-lan", "--host-name", "robot.lab"});
  const auto open = start_console(arguments);
  ASSERT_TRUE(open);
  EXPECT_EQ(status(open->port, "robot.lab:8765"), "200");
  std::string name(256, '\0');
  ASSERT_EQ(::gethostname(name.data(), name.size() - 1), 0);
  name.resize(name.find('\0'));
  EXPECT_EQ(status(open->port, name + ":" + std::to_string(open->port)), "200");
  EXPECT_EQ(status(open->port, "evil.com"), "403");
  const std::string& output = open->process.output();
  EXPECT_EQ(output.find("http://0.0.0.0"), std::string::npos) << output;
  expect_text(output, {"http://127.0.0.1:", "for other hosts: http://" + name + ":"});
}

}  // namespace
}  // namespace rtpm::system_test
