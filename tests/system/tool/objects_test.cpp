#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "programs.hpp"

// Commands that inspect servers, beside a registry and a device server.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Objects : public Laboratory {
 protected:
  /// The output of `rtpm … --json`; it must succeed.
  [[nodiscard]] Json json_of(std::vector<std::string> arguments) const {
    arguments.emplace_back("--json");
    const auto end = rtpm(arguments);
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    return Json::parse(end.output, nullptr, false);
  }
};

TEST_F(Objects, AreListedForPeopleAndMachines) {
  const auto listed = rtpm({"list"});
  EXPECT_EQ(listed.output, "lab/arm0  rtpm.device.Device  " + device_->url + "\n");
  const Json names = json_of({"list"});
  ASSERT_EQ(names.size(), 1u) << names;
  EXPECT_EQ(names[0]["name"], "lab/arm0");
  EXPECT_EQ(names[0]["url"], device_->url);
  const Json objects = json_of({"list", "lab/arm0"});
  EXPECT_GE(objects.size(), 2u) << objects;
  EXPECT_EQ(objects[0]["path"], "lab/arm0");
}

TEST_F(Objects, AreDescribedWithTheirMethodsAndParameters) {
  const Json info = json_of({"info", "lab/arm0"});
  EXPECT_EQ(info["interface"], "rtpm.device.Device");
  EXPECT_EQ(info["url"], device_->url);
  bool reads = false;
  for (const Json& method : info["methods"])
    reads = reads || method["name"] == "read";
  EXPECT_TRUE(reads) << info["methods"];
  EXPECT_GE(info["device"]["parameters"].size(), 9u);
  EXPECT_EQ(info["device"]["lifecycle"], "active");
  const auto shown = rtpm({"info", "lab/arm0"});
  EXPECT_EQ(shown.exit_code, 0) << shown.errors;
  expect_text(shown.output, {"class       haptic", "rate        1000 Hz", "lifecycle   active",
                             "parameters  ", "methods     describe, read, command"});
  EXPECT_LE(test::line_count(shown.output), 24) << "one screen";
  expect_one_sentence(rtpm({"info", device_->url + "7"}), 3, {"most like it there: lab/arm0"});
}

TEST_F(Objects, AreFoundByPatterns) {
  for (const std::vector<std::string>& pattern : std::vector<std::vector<std::string>>{
           {"lab/*"}, {"--interface", "rtpm.device.*"}, {"--host", "127.0.0.?"}}) {
    std::vector<std::string> arguments{"find"};
    arguments.insert(arguments.end(), pattern.begin(), pattern.end());
    EXPECT_EQ(json_of(arguments).size(), 1u) << pattern.front();
  }
  expect_one_sentence(rtpm({"find", "--interface", "rtpm.device.Devise"}), 1,
                      {"none of the 1 names fits", "'rtpm.device.Device'"});
  // The predicate leaves no name for the patterns.
  expect_one_sentence(rtpm({"find", "--where", "rate_hz > 1e9"}), 1, {"none of the 1 names fits"});
  // The first of two sentences says that no such name has the property.
  const auto none = rtpm({"find", "--interface", "rtpm.device.Devise", "--where", "rate_hz > 1"});
  EXPECT_EQ(none.exit_code, 1);
  expect_text(none.errors, {"none of the 1 names fits (did you mean 'rtpm.device.Device'"});
}

TEST_F(Objects, GetPermanentNames) {
  const std::vector<std::string> bind{"bind",         "lab/camera", "rtpm://10.0.0.7:7500/camera",
                                      "--interface",  "lab.Camera", "--property",
                                      "rate:hertz=30"};
  const auto bound = rtpm(bind);
  EXPECT_EQ(bound.exit_code, 0) << bound.errors;
  EXPECT_EQ(rtpm({"resolve", "lab/camera/settings"}).output,
            "rtpm://10.0.0.7:7500/camera/settings\n");
  const Json resolved = json_of({"resolve", "lab/camera"});
  EXPECT_EQ(resolved["is_permanent"], true);
  EXPECT_EQ(resolved["properties"]["rate"], 30);
  EXPECT_EQ(resolved["units"]["rate"], "hertz");
  expect_one_sentence(rtpm(bind), 1, {"'lab/camera' is held by another", "--replace takes it"});
  std::vector<std::string> replace = bind;
  replace[2] = "rtpm://10.0.0.8:7500/camera";
  replace.emplace_back("--replace");
  EXPECT_TRUE(json_of(replace).contains("revision"));
  EXPECT_EQ(rtpm({"resolve", "lab/camera"}).output, "rtpm://10.0.0.8:7500/camera\n");
  expect_one_sentence(
      rtpm({"bind", "lab/b", "rtpm://h:1/p", "--interface", "lab.B", "--property", "rate"}), 2,
      {"'rate' is no property"});
  EXPECT_TRUE(json_of({"unbind", "lab/camera"}).contains("revision"));
  EXPECT_EQ(rtpm({"unbind", "lab/camera"}).exit_code, 3);
  EXPECT_EQ(rtpm({"resolve", "lab/camera"}).exit_code, 3);
}

TEST_F(Objects, AreFoundByTheirProperties) {
  const auto found = rtpm({"find", "--where", "'x' in axes and force_newton_max > 1"});
  EXPECT_EQ(found.exit_code, 0) << found.errors;
  EXPECT_EQ(found.output, "lab/arm0  rtpm.device.Device  " + device_->url + "\n");
  const Json json = json_of({"find", "--where", "class == 'haptic'", "--prefer", "max rate_hz"});
  ASSERT_EQ(json.size(), 1u) << json;
  EXPECT_EQ(json[0]["properties"]["rate_hz"], 1000.0);
  EXPECT_EQ(json[0]["units"]["force_newton_max"], "newton");
  const auto none = rtpm({"find", "--where", "class == 'tracker' or force_newtons > 3"});
  EXPECT_EQ(none.exit_code, 1);
  expect_text(none.errors, {"has the property 'force_newtons' (did you mean"});
  const auto wrong = rtpm({"find", "--where", "class = 'haptic'"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_EQ(wrong.errors, "rtpm: class = 'haptic'\nrtpm:       ^ write '=='\n");
  const auto misused = rtpm({"find", "--prefer", "max class + 1", "--json"});
  EXPECT_EQ(misused.exit_code, 2);
}

TEST_F(Objects, AreWatchedAsTheyComeAndGo) {
  test::Process watch({path_of("rtpm"), "watch", "--json", "--registry", registry_->url});
  ASSERT_TRUE(watch.wait_for_output("\"bound\"", kPatience)) << watch.errors();
  device_->process.send_signal(SIGTERM);
  ASSERT_TRUE(watch.wait_for_output("\"gone\"", kPatience)) << watch.output();
  const auto again = start_server("rtpm-deviced", {"--devices", "knob0"});
  ASSERT_TRUE(again);
  ASSERT_TRUE(watch.wait_for_output("lab/knob0", kPatience)) << watch.output();
  watch.send_signal(SIGINT);
  const auto end = watch.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  const Json first = Json::parse(end->output.substr(0, end->output.find('\n')), nullptr, false);
  EXPECT_EQ(first["name"], "lab/arm0");
}

TEST_F(Objects, AreTakenOverAndStoppedInJson) {
  const auto held = rtpm({"take-over", "lab/arm0", "deactivate", "--for", "100ms", "--json"});
  EXPECT_EQ(held.exit_code, 0) << held.errors;
  EXPECT_EQ(test::line_count(held.output), 3) << held.output;
  EXPECT_NE(held.output.find("\"inactive\""), std::string::npos) << held.output;
  const Json first = Json::parse(held.output.substr(0, held.output.find('\n')), nullptr, false);
  EXPECT_EQ(first["state"], "held");
  const auto stopped = json_of({"estop", "lab/arm0"});
  EXPECT_EQ(stopped["is_stopped"], true);
  expect_one_sentence(rtpm({"take-over", "lab/arm0", "fly"}), 2, {"{recover,activate"});
}

}  // namespace
}  // namespace rtpm::system_test
