#include "rtpm/driver_host/plugin.hpp"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace rtpm::driver_host {
namespace {

std::string plugin(const std::string& name) {
  return std::string(RTPM_PLUGIN_FOLDER) + "/" + name + ".so";
}

void expect_words(const SetupError& error, const std::vector<std::string>& words) {
  EXPECT_FALSE(error.remedy.empty()) << error.text();
  for (const std::string& word : words) {
    EXPECT_NE(error.text().find(word), std::string::npos) << word << " is not in: " << error.text();
  }
}

/// Expects the plug-in in `file` to be refused with all of `words`.
void expect_refusal(const std::string& file, const std::string& arguments,
                    const std::vector<std::string>& words) {
  const auto driver = load_plugin(file, arguments);
  ASSERT_FALSE(driver) << file << ' ' << arguments;
  expect_words(driver.error(), words);
}

std::unique_ptr<driver::Driver> load(const std::string& arguments) {
  auto driver = load_plugin(plugin("plugin"), arguments);
  RTPM_ASSERT(driver.has_value(), "the plug-in could not be loaded");
  return std::move(*driver);
}

TEST(Plugin, BecomesADriver) {
  const auto driver = load("");
  EXPECT_EQ(driver->describe().model, "gripper");
  EXPECT_TRUE(driver->configure({}));
  EXPECT_TRUE(driver->activate());
  driver::Sample sample;
  EXPECT_EQ(driver->exchange({}, sample), driver::ExchangeStatus::kOk);
  EXPECT_EQ(sample.buttons, 5u);
  ASSERT_EQ(driver->parameters().size(), 1u);
  EXPECT_EQ(driver->parameters()[0].name, "offset");
  std::vector<driver::ParameterSetting> settings{{.name = "offset", .value = 0.5}};
  EXPECT_TRUE(driver->set_parameters(settings));
  ASSERT_EQ(driver->calibrations().size(), 1u);
  EXPECT_EQ(driver->calibrations()[0].name, "zero");
  EXPECT_EQ(driver->make_calibration("one"), nullptr);
  driver->deactivate();
}

TEST(Plugin, StaysLoadedForACalibrationThatOutlivesItsDriver) {
  auto driver = load("");
  const auto calibration = driver->make_calibration("zero");
  ASSERT_NE(calibration, nullptr);
  driver.reset();
  const auto state = calibration->step({}, std::nullopt);
  ASSERT_TRUE(std::holds_alternative<driver::CalibrationDone>(state));
  EXPECT_EQ(std::get<driver::CalibrationDone>(state).summary, "done");
}

TEST(Plugin, MakesAsManyDriversAsThereAreDevices) {
  auto first = load("");
  const auto second = load("configure");
  EXPECT_TRUE(first->configure({}));
  EXPECT_FALSE(second->configure({})) << "each has arguments of its own";
  first.reset();
  EXPECT_TRUE(second->activate()) << "and keeps the plug-in loaded";
}

TEST(Plugin, NeedsNoPathInTheWorkingFolder) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(RTPM_PLUGIN_FOLDER);
  EXPECT_TRUE(load_plugin("plugin.so", ""));
  std::filesystem::current_path(before);
}

TEST(Plugin, IsNotSearchedForAmongTheSystemsLibraries) {
  expect_refusal("libm.so.6", "",
                 {"libm.so.6", "can't be loaded", "No such file", "name the file"});
}

TEST(Plugin, IsRefusedIfItIsNotALibrary) {
  expect_refusal("/nowhere/lever.so", "", {"/nowhere/lever.so", "No such file", "name the file"});
  const auto text = std::filesystem::path(testing::TempDir()) / "rtpm_no_library.so";
  std::ofstream(text) << "this is a text\n";
  expect_refusal(text.string(), "", {"rtpm_no_library.so", "can't be loaded", "name the file"});
  std::ofstream(text, std::ios::trunc).flush();
  expect_refusal(text.string(), "", {"rtpm_no_library.so", "file too short"});
  std::filesystem::remove(text);
  expect_refusal(testing::TempDir(), "", {"can't be loaded"});
}

TEST(Plugin, IsRefusedWithoutTheSymbol) {
  expect_refusal(
      plugin("no_symbol"), "",
      {"no_symbol.so is no plug-in", "does not export rtpm_driver_plugin", "RTPM_DRIVER_PLUGIN"});
}

/// A plug-in kept loaded, so that its counter outlives the refusal.
class Watched {
 public:
  explicit Watched(const std::string& file) : handle_(dlopen(file.c_str(), RTLD_NOW)) {}
  Watched(const Watched&) = delete;
  Watched& operator=(const Watched&) = delete;
  ~Watched() { dlclose(handle_); }
  [[nodiscard]] bool is_loaded() const { return handle_ != nullptr; }
  [[nodiscard]] int created_count() const {
    return *static_cast<const int*>(dlsym(handle_, "created_count"));
  }

 private:
  void* handle_;
};

TEST(Plugin, IsRefusedForAnotherVersionBeforeItRuns) {
  const std::vector<std::pair<std::string, std::string>> foreigners{
      {"foreign_abi", "the version of the interface is 2 there and 1 here"},
      {"foreign_sample", "the size of Sample is "},
      {"foreign_command", "the size of Command is "},
      {"foreign_descriptor", "the size of Descriptor is "},
      {"foreign_compiler", "the compiler's ABI is "},
      {"foreign_magic", "its rtpm_driver_plugin is something else"},
      {"no_function", "names no function that makes a driver"}};
  for (const auto& [name, words] : foreigners) {
    const Watched watched(plugin(name));
    ASSERT_TRUE(watched.is_loaded()) << name;
    expect_refusal(plugin(name), "", {name + ".so", words});
    EXPECT_EQ(watched.created_count(), 0) << name << " ran";
  }
}

/// Otherwise plug-ins see each other's classes if a program loads them with RTLD_GLOBAL.
TEST(Plugin, ExportsItsOneSymbol) {
  for (const std::string name : {"plugin", "puppet"}) {
    void* const handle = dlopen(plugin(name).c_str(), RTLD_NOW | RTLD_GLOBAL);
    ASSERT_NE(handle, nullptr) << dlerror();
    EXPECT_NE(dlsym(handle, "rtpm_driver_plugin"), nullptr);
    for (const char* const hidden :
         {"_ZTVN4rtpm6driver6DriverE", "_ZTIN4rtpm6driver6DriverE",
          "_ZN4rtpm6driver6Driver16make_calibrationESt17basic_string_viewIcSt11char_traitsIcEE"}) {
      EXPECT_EQ(dlsym(handle, hidden), nullptr) << name << " exports " << hidden;
    }
    dlclose(handle);
  }
}

TEST(Plugin, IsRefusedIfItMakesNoDriver) {
  expect_refusal(plugin("plugin"), "error", {"no gripper", "buy one"});
  expect_refusal(plugin("plugin"), "null", {"plugin.so made no driver", "ask its author"});
}

TEST(Plugin, IsRefusedIfItThrowsAtSetUp) {
  for (const std::string place : {"create", "describe", "parameters", "calibrations"}) {
    expect_refusal(plugin("plugin"), place,
                   {"plugin.so failed in " + place + "()", "the gripper is stuck", "author"});
    expect_refusal(plugin("plugin"), place + ":int",
                   {"plugin.so failed in " + place + "()", "no std::exception", "author"});
  }
}

TEST(Plugin, ReturnsAnErrorIfItThrowsLater) {
  for (const auto& [kind, words] : {std::pair{std::string(), "the gripper is stuck"},
                                    std::pair{std::string(":int"), "no std::exception"}}) {
    const auto configured = load("configure" + kind)->configure({});
    ASSERT_FALSE(configured);
    expect_words(configured.error(), {"plugin.so failed in configure()", words});
    const auto activated = load("activate" + kind)->activate();
    ASSERT_FALSE(activated);
    expect_words(activated.error(), {"plugin.so failed in activate()", words});
    const auto set = load("set_parameters" + kind)->set_parameters({});
    ASSERT_FALSE(set);
    expect_words(set.error(), {"plugin.so failed in set_parameters()", words});
  }
}

TEST(Plugin, ACalibrationThatThrowsFailsWithTheReason) {
  for (const std::string place : {"make_calibration", "step"}) {
    const auto calibration = load(place)->make_calibration("zero");
    ASSERT_NE(calibration, nullptr) << place;
    const auto state = calibration->step({}, std::nullopt);
    ASSERT_TRUE(std::holds_alternative<driver::CalibrationFailed>(state)) << place;
    const std::string& reason = std::get<driver::CalibrationFailed>(state).reason;
    EXPECT_NE(reason.find(place + "(): it threw: the gripper is stuck"), std::string::npos)
        << reason;
  }
}

}  // namespace
}  // namespace rtpm::driver_host
