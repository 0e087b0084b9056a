#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"

// `rtpm doctor`, `lanes` and `version`: about this host and the servers that it reaches.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Host : public Laboratory {
 protected:
  [[nodiscard]] Json json_of(std::vector<std::string> arguments) const {
    arguments.emplace_back("--json");
    return Json::parse(rtpm(arguments).output, nullptr, false);
  }
};

const Json* finding_of(const Json& findings, const std::string& id) {
  const auto found =
      std::ranges::find_if(findings, [&](const Json& finding) { return finding["id"] == id; });
  return found == findings.end() ? nullptr : &*found;
}

TEST_F(Host, IsJudgedWithWakeUpsAndServers) {
  const auto end = rtpm({"doctor", "--time", "100ms"});
  expect_text(end.output,
              {"realtime", "idle-states", "socket-buffers", "shared-memory", "clock-sync",
               "servers", "port-7420", " wake-ups at 1 kHz", "wake-ups", "load"});
  const bool is_problem = end.output.find("\nproblem ") != std::string::npos;
  EXPECT_EQ(end.exit_code, is_problem ? 1 : 0) << end.output;
  EXPECT_EQ(end.output.starts_with("0 problems"), !is_problem) << end.output;
  const auto whole = rtpm({"doctor", "--quick", "--all"});
  expect_text(whole.output, {"servers: all 1 names of the registry answer"});
}

TEST_F(Host, IsJudgedInJson) {
  const Json json = json_of({"doctor", "--time", "50ms"});
  EXPECT_GT(json["wake_ups"]["count"], 10) << json;
  EXPECT_LE(json["wake_ups"]["late_us"]["p50"], json["wake_ups"]["late_us"]["max"]);
  for (const char* id :
       {"kernel", "throttling", "memory-lock", "multicast", "port-7421", "servers"})
    EXPECT_NE(finding_of(json["findings"], id), nullptr) << id;
  for (const Json& finding : json["findings"]) {
    const bool is_bad = finding["severity"] == "warning" || finding["severity"] == "problem";
    EXPECT_TRUE(!is_bad || (finding["cost"] != "" && finding["remedy"] != "")) << finding;
    EXPECT_EQ(finding["fixable"], finding.contains("lasting")) << finding;
    EXPECT_EQ(finding["fixed"], false) << finding;
  }
  EXPECT_FALSE(json_of({"doctor", "--quick"}).contains("wake_ups"));
}

TEST_F(Host, MeasuresStimuliAndRecordsTheFigures) {
  const auto board = start_server("rtpm-deviced", {"--devices", "stimulus0", "--serve-events"});
  ASSERT_TRUE(board);
  const auto measured = rtpm({"doctor", "--latency", "lab/stimulus0", "--json"});
  ASSERT_EQ(measured.exit_code, 0) << measured.errors;
  const Json json = Json::parse(measured.output, nullptr, false);
  const auto loops = json["loops"];
  ASSERT_EQ(loops.size(), 3u) << json;
  const double error_ms = json["clock_uncertainty_ms"].get<double>() + 1;
  const std::vector<std::pair<std::string, double>> expected{
      {"photodiode", 12}, {"microphone", 5}, {"key", 2}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(loops[i]["sensor"], expected[i].first) << json;
    EXPECT_GT(loops[i]["count"], 7) << json;
    // The sensor follows after its delay, never before.
    EXPECT_GE(loops[i]["to_sample_ms"]["min"], expected[i].second - error_ms) << json;
    EXPECT_LE(loops[i]["to_sample_ms"]["min"], loops[i]["to_reader_ms"]["min"]) << json;
  }
  expect_text(rtpm({"doctor", "--latency", "lab/stimulus0"}).output,
              {"flash", "photodiode", "TO SAMPLE MS"});
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  EXPECT_EQ(rtpm({"record", file, "--for", "100ms"}).exit_code, 0);
  expect_text(rtpm({"bag", "info", file}).output,
              {"rtpm.clocks", "measured = begin", "measured = end", "lab/stimulus0/offset_ns",
               "rtpm/events/uncertainty_ns", "rtpm.latency", "lab/stimulus0/flash = photodiode"});
  expect_one_sentence(rtpm({"doctor", "--latency", "lab/arm0"}), 1, {"has no outputs"});
}

TEST_F(Host, ComparesClocks) {
  const Json json = json_of({"clocks", "--for", "20ms"});
  ASSERT_EQ(json["clocks"].size(), 1u) << json;
  EXPECT_GE(json["clocks"][0]["uncertainty_us"], 0);  // 0 by shared memory: one clock.
  EXPECT_LE(std::abs(json["clocks"][0]["offset_us"].get<double>()),
            json["clocks"][0]["uncertainty_us"].get<double>());
  ASSERT_EQ(rtpm({"bind", "lab/ghost", "rtpm://127.0.0.1:1/x", "--interface", "lab.X"}).exit_code,
            0);
  const auto end = rtpm({"clocks", "--for", "20ms"});
  EXPECT_EQ(end.exit_code, 1) << end.output;
  expect_text(end.output, {"rtpm://127.0.0.1:1", "unknown"});
}

TEST_F(Host, IsUnchangedByADryFix) {
  const Json before = json_of({"doctor", "--quick"});
  const Json dry = json_of({"doctor", "--quick", "--fix", "--dry-run"});
  EXPECT_FALSE(before.contains("changes"));
  bool is_fixable = false;
  for (const Json& finding : before["findings"])
    is_fixable = is_fixable || finding["fixable"] == true;
  EXPECT_EQ(dry["changes"].empty(), !is_fixable) << dry;
  for (const Json& change : dry["changes"])
    EXPECT_EQ(change["is_made"], false) << change;
  const auto text = rtpm({"doctor", "--quick", "--fix", "--dry-run"});
  expect_text(text.output, {is_fixable ? "would change /" : "nothing to fix"});
}

TEST_F(Host, IsFixedAndJudgedAgain) {
  const auto namespaces = test::run({"unshare", "-rm", "true"}, kPatience);
  if (!namespaces || namespaces->exit_code != 0) {
    GTEST_SKIP() << "needs the right to make a mount namespace (unshare -rm)";
  }
  // These files replace the system's for this one program.
  const recording::Folder folder;
  const std::string buffer = folder.fresh("rmem_max");
  recording::put_content(buffer, "212992\n");
  const auto end = test::run(
      {"unshare", "-rm", "sh", "-c",
       "mount --bind \"$1\" /proc/sys/net/core/rmem_max && exec \"$0\" doctor --quick --fix --json",
       path_of("rtpm"), buffer},
      kPatience);
  ASSERT_TRUE(end);
  const Json json = Json::parse(end->output, nullptr, false);
  const Json* const finding = finding_of(json["findings"], "socket-buffers");
  ASSERT_NE(finding, nullptr) << end->output << end->errors;
  EXPECT_NE((*finding)["finding"].get<std::string>().find("4096 KiB to receive"), std::string::npos)
      << *finding;
  const auto change = std::ranges::find_if(json["changes"], [](const Json& made) {
    return made["path"] == "/proc/sys/net/core/rmem_max";
  });
  ASSERT_NE(change, json["changes"].end()) << json["changes"];
  EXPECT_EQ((*change)["from"], "212992");
  EXPECT_EQ((*change)["to"], "4194304");
  EXPECT_EQ((*change)["is_made"], true) << *change;
  EXPECT_EQ(recording::content_of(buffer), "4194304");
}

TEST_F(Host, ReportsARegisteredServerThatIsGone) {
  device_->process.send_signal(SIGKILL);
  ASSERT_TRUE(device_->process.wait(kPatience));
  const auto end = rtpm({"doctor", "--quick", "--json"});
  const Json json = Json::parse(end.output, nullptr, false);
  const Json* const finding = finding_of(json["findings"], "server");
  ASSERT_NE(finding, nullptr) << end.output;
  EXPECT_EQ((*finding)["severity"], "problem");
  EXPECT_NE((*finding)["finding"].get<std::string>().find("'lab/arm0'"), std::string::npos);
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_EQ(json["is_fit"], false);
}

TEST_F(Host, IsJudgedWithoutARegistry) {
  const auto end = run_program(
      "rtpm", {"doctor", "--quick", "--json", "--registry", "rtpm://127.0.0.1:1/rtpm/names"});
  const Json json = Json::parse(end.output, nullptr, false);
  const Json* const finding = finding_of(json["findings"], "registry");
  ASSERT_NE(finding, nullptr) << end.output;
  EXPECT_EQ((*finding)["severity"], "note");
  EXPECT_NE((*finding)["remedy"].get<std::string>().find("rtpm-registryd"), std::string::npos);
}

TEST_F(Host, ShowsTheVersionOfItsServers) {
  const Json json = json_of({"version", "lab/arm0"});
  EXPECT_EQ(json["target"]["is_same"], true) << json;
  EXPECT_EQ(json["rtpm"], json["target"]["rtpm"]);
  EXPECT_EQ(json["protocol"], 1);
  const auto text = rtpm({"version"});
  EXPECT_TRUE(text.output.starts_with("rtpm " + json["rtpm"].get<std::string>()));
}

TEST_F(Host, ShowsLanesAndDevicesOnce) {
  const auto end = rtpm({"top", "--interval", "200ms"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {"1 devices", "CALLS/S", "registry@", "READ P50", "lab/arm0  active"});
  const Json json = json_of({"top", "--once", "--interval", "500ms"});
  ASSERT_EQ(json["devices"].size(), 1u) << json;
  EXPECT_EQ(json["devices"][0]["lifecycle"], "active");
  EXPECT_GT(json["devices"][0]["cycles_per_s"], 100.0);
  EXPECT_TRUE(std::ranges::any_of(json["lanes"], [&](const Json& lane) {
    return lane["calls_per_s"] > 0.0;
  })) << json;
}

TEST_F(Host, IsShownLiveOnATerminalUntilQ) {
  const auto end = test::run(
      {"sh", "-c",
       "(sleep 0.7; printf l; sleep 0.3; printf q) | TERM=xterm script -qec \"$0 top --interval "
       "100ms --registry $1\" /dev/null",
       path_of("rtpm"), registry_->url},
      kPatience);
  ASSERT_TRUE(end) << "q does not end it";
  EXPECT_EQ(end->exit_code, 0) << end->output;
  expect_text(end->output, {"sorted by calls", "longest", "lab/arm0", "q quit"});
}

TEST_F(Host, ShowsItsLanesWithoutARegistry) {
  const auto end = run_program(
      "rtpm", {"top", "--interval", "100ms", "--registry", "rtpm://127.0.0.1:1/rtpm/names"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {"no registry answers", "registry@"});
}

}  // namespace
}  // namespace rtpm::system_test
