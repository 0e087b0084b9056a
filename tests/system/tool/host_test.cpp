#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "programs.hpp"

// `rtpm doctor`, `lanes` and `version`: about this host and the servers that it reaches.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Host : public Laboratory {
 protected:
  [[nodiscard]] test::Process::End rtpm(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--registry", registry_->url});
    return run_program("rtpm", arguments);
  }
  [[nodiscard]] Json json_of(std::vector<std::string> arguments) const {
    arguments.emplace_back("--json");
    return Json::parse(rtpm(arguments).output, nullptr, false);
  }
};

const Json* note_of(const Json& notes, const std::string& subject) {
  const auto found =
      std::ranges::find_if(notes, [&](const Json& note) { return note["subject"] == subject; });
  return found == notes.end() ? nullptr : &*found;
}

TEST_F(Host, IsJudgedWithWakeUpsAndServers) {
  ASSERT_TRUE(registry_ && device_);
  const auto end = rtpm({"doctor", "--time", "100ms"});
  for (const char* words : {"real-time", "idle states", "socket buffers", "shared memory",
                            "clock sync", "names of the registry answer", " wake-ups at 1 kHz"})
    EXPECT_NE(end.output.find(words), std::string::npos) << words << " is not in\n" << end.output;
  const bool is_refused = end.output.find("refused") != std::string::npos;
  EXPECT_EQ(end.exit_code, is_refused ? 1 : 0);
}

TEST_F(Host, IsJudgedInJson) {
  const Json json = json_of({"doctor", "--time", "50ms"});
  EXPECT_GT(json["wake_ups"]["count"], 10) << json;
  EXPECT_LE(json["wake_ups"]["late_us"]["p50"], json["wake_ups"]["late_us"]["max"]);
  for (const char* subject : {"kernel", "throttling", "memory lock", "servers"}) {
    const Json* const note = note_of(json["notes"], subject);
    ASSERT_NE(note, nullptr) << subject;
    EXPECT_TRUE((*note)["grant"] != "partly" || (*note)["remedy"] != "") << *note;
  }
  EXPECT_FALSE(json_of({"doctor", "--quick"}).contains("wake_ups"));
}

TEST_F(Host, SeesAServerThatIsNamedButGone) {
  device_->process.send_signal(SIGKILL);
  ASSERT_TRUE(device_->process.wait(kPatience));
  const auto end = rtpm({"doctor", "--quick", "--json"});
  const Json* note = nullptr;
  const Json json = Json::parse(end.output, nullptr, false);
  note = note_of(json["notes"], "'lab/arm0'");
  ASSERT_NE(note, nullptr) << end.output;
  EXPECT_EQ((*note)["grant"], "refused");
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_EQ(json["is_fit"], false);
}

TEST_F(Host, ShowsItsLanesInJson) {
  const Json lanes = json_of({"lanes"});
  EXPECT_TRUE(std::ranges::any_of(lanes, [&](const Json& lane) {
    return lane["port"] == registry_->port() && lane["call_count"] > 0;
  })) << lanes;
  EXPECT_EQ(rtpm({"lanes", "always"}).exit_code, 2);
}

TEST_F(Host, HasTheVersionOfItsServers) {
  const Json json = json_of({"version", "lab/arm0"});
  EXPECT_EQ(json["target"]["is_same"], true) << json;
  EXPECT_EQ(json["rtpm"], json["target"]["rtpm"]);
  EXPECT_EQ(json["protocol"], 1);
  const auto text = rtpm({"version"});
  EXPECT_TRUE(text.output.starts_with("rtpm " + json["rtpm"].get<std::string>()));
  expect_one_sentence(rtpm({"version", "lab/arm1"}), 3, {"lab/arm1"});
}

}  // namespace
}  // namespace rtpm::system_test
