#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"

// A session of an experiment: recorded, shown, and its parameters set again.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Sessions : public WithRegistry {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    devices_ = start_server("rtpm-deviced", {"--devices", "arm0,gaze0", "--serve-events"});
    ASSERT_TRUE(devices_);
  }
  [[nodiscard]] std::string value_of(const std::string& name) const {
    return rtpm({"config", "get", "lab/arm0", name}).output;
  }
  /// The only recording in the folder.
  [[nodiscard]] std::string file() const {
    std::string found;
    const auto folder = std::filesystem::path(folder_.path("run")).parent_path();
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".mcap") found = entry.path().string();
    return found;
  }

  std::optional<Daemon> devices_{};
  recording::Folder folder_{};
};

TEST_F(Sessions, AreRecordedShownAndTheirParametersSetAgain) {
  const std::string pattern = folder_.path("{experiment}_{participant}_{condition}");
  ASSERT_EQ(rtpm({"config", "set", "lab/arm0", "safety.force_newton_max=2.5"}).exit_code, 0);
  test::Process session({path_of("rtpm"), "session", "--participant", "P07", "--experiment",
                         "touch", "--condition", "soft", "--notes", "left hand", "--pattern",
                         pattern, "--registry", registry_->url});
  ASSERT_TRUE(session.wait_for_output(" until Ctrl-C", kPatience)) << session.errors();
  ASSERT_EQ(rtpm({"mark", "yawns"}).exit_code, 0);
  ASSERT_EQ(rtpm({"config", "set", "lab/arm0", "safety.force_newton_max=1.5"}).exit_code, 0);
  session.send_signal(SIGINT);
  const auto end = session.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_text(end->output, {"touch_P07_soft.mcap", " messages, ", " 0 dropped"});

  const std::string path = file();
  ASSERT_TRUE(path.ends_with("touch_P07_soft.mcap")) << path;
  expect_text(rtpm({"bag", "info", path}).output,
              {"participant  P07", "condition    soft", "notes        left hand", "rtpm.versions",
               "kernel = ", "lab/gaze0", "PARAMETERS"});
  const Json info =
      Json::parse(rtpm({"bag", "info", path, "--parameters", "--json"}).output, nullptr, false);
  ASSERT_FALSE(info.is_discarded());
  EXPECT_EQ(info["session"]["participant"], "P07");
  ASSERT_EQ(info["parameters"].size(), 2u) << info["parameters"];
  EXPECT_EQ(info["parameters"][0]["device"], "lab/arm0");
  ASSERT_EQ(info["parameters"][0]["changes"].size(), 1u);
  EXPECT_EQ(info["parameters"][0]["changes"][0]["values"],
            Json({{"safety.force_newton_max", 1.5}}));
  EXPECT_EQ(info["parameters"][1]["change_count"], 0);

  // A part of it says as much.
  const std::string part = folder_.path("part");
  ASSERT_EQ(rtpm({"bag", "cut", path, "--from", "20ms", "-o", part}).exit_code, 0);
  const Json of_part = Json::parse(rtpm({"bag", "info", part, "--json"}).output, nullptr, false);
  EXPECT_EQ(of_part["session"], info["session"]);
  EXPECT_EQ(of_part["parameters"].size(), 2u) << of_part["parameters"];
  std::filesystem::remove(part);

  // As at the beginning; and again, when nothing differs.
  const auto restored = rtpm({"play", path, "--parameters"});
  EXPECT_EQ(restored.exit_code, 0) << restored.errors;
  expect_text(restored.output,
              {"lab/arm0: 1 set", "safety.force_newton_max=2.5", "lab/gaze0: 0 set"});
  EXPECT_EQ(value_of("safety.force_newton_max"), "safety.force_newton_max=2.5\n");
  expect_text(rtpm({"play", path, "--parameters", "--devices", "lab/arm0"}).output,
              {"lab/arm0: 0 set"});
}

TEST_F(Sessions, RefuseWhatTheyCantStateOrName) {
  expect_one_sentence(rtpm({"session", "--participant", "P07\x1b[2J", "--for", "1s"}), 2,
                      {"participant", "can't be shown"});
  expect_one_sentence(rtpm({"session", "--pattern", "{subject}", "--for", "1s"}), 2,
                      {"{subject}", "{participant}"});
  expect_one_sentence(
      rtpm({"session", "--pattern", folder_.path("{date}"), "--only", "lab/arm7", "--for", "1s"}),
      1, {"lab/arm7"});
  EXPECT_EQ(file(), "") << "nothing was recorded";
}

TEST_F(Sessions, RecordOnlyWhatIsChosen) {
  const std::string path = folder_.path("only.mcap");
  ASSERT_EQ(rtpm({"record", path, "--only", "lab/gaze0", "--for", "600ms"}).exit_code, 0);
  const Json info = Json::parse(rtpm({"bag", "info", path, "--json"}).output, nullptr, false);
  ASSERT_EQ(info["parameters"].size(), 1u) << info;
  EXPECT_EQ(info["parameters"][0]["device"], "lab/gaze0");
  for (const Json& channel : info["channels"])
    EXPECT_EQ(channel["topic"].get<std::string>().find("lab/arm0"), std::string::npos) << channel;
}

TEST_F(Sessions, ChangeNoOtherUnit) {
  const std::string path = folder_.path("run.mcap");
  ASSERT_EQ(rtpm({"record", path, "--for", "600ms"}).exit_code, 0);
  devices_->process.send_signal(SIGTERM);
  ASSERT_TRUE(devices_->process.wait(kPatience));
  const auto gone = rtpm({"play", path, "--parameters", "--devices", "lab/arm0"});
  EXPECT_EQ(gone.exit_code, 1);
  expect_text(gone.output, {"lab/arm0: refused, nothing changed"});
  expect_one_sentence(rtpm({"play", path, "--parameters", "--devices", "lab/arm7"}), 1,
                      {"no parameters of 'lab/arm7'"});
}

}  // namespace
}  // namespace rtpm::system_test
