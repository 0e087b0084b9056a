#include "rtpm/configuration/settings_store.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "rtpm/test/temporary_folder.hpp"
#include "samples.hpp"

namespace rtpm::gvd {
namespace {

using Settings = std::vector<driver::ParameterSetting>;

class SettingsFile : public testing::Test {
 protected:
  [[nodiscard]] SettingsStore store(const std::string& serial = "t-1") const {
    return {folder_.string(), "test arm", serial};
  }
  [[nodiscard]] std::string content() const {
    std::ostringstream text;
    text << std::ifstream(store().path()).rdbuf();
    return text.str();
  }
  void write(const std::string& text) const { std::ofstream(store().path()) << text; }
  void save_sample() const { ASSERT_TRUE(store().save(Settings{{"filter.on", false}})); }
  void expect_refused(const std::string& why) const {
    const auto loaded = store().load(specs_);
    ASSERT_FALSE(loaded) << why;
    const std::string text = loaded.error().text();
    EXPECT_NE(text.find(store().path()), std::string::npos) << text;
    EXPECT_NE(text.find(why), std::string::npos) << text;
    EXPECT_NE(text.find("Remedy: "), std::string::npos) << text;
  }

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
  std::vector<driver::ParameterSpec> specs_ = test::sample_specs();
};

TEST_F(SettingsFile, IsOptional) {
  const auto loaded = store().load(specs_);
  ASSERT_TRUE(loaded) << loaded.error().text();
  EXPECT_TRUE(loaded->settings.empty() && loaded->ignored.empty());
}

TEST_F(SettingsFile, HasEveryTypeExactly) {
  const Settings saved{{"encoder.offset_m", std::vector<double>{0.1 * 0.3, -1e-17, 0}},
                       {"filter.on", false},
                       {"filter.taps", std::int64_t{3}},
                       {"label", std::string("linker Arm \"ü\"")},
                       {"mode", std::string("fast")},
                       {"safety.force_newton_max", 5.0}};
  ASSERT_TRUE(store().save(saved));
  const auto loaded = store().load(specs_);
  ASSERT_TRUE(loaded) << loaded.error().text();
  EXPECT_EQ(loaded->settings, saved);
  EXPECT_TRUE(loaded->ignored.empty());
}

TEST_F(SettingsFile, IsReplacedWhole) {
  ASSERT_TRUE(store().save(Settings{{"label", std::string(200, 'a')}}));
  ASSERT_TRUE(store().save({}));
  const auto loaded = store().load(specs_);
  ASSERT_TRUE(loaded);
  EXPECT_TRUE(loaded->settings.empty());
  int count = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder_)) {
    count += file.path().string() == store().path() ? 1 : 100;
  }
  EXPECT_EQ(count, 1) << "no other file is left";
}

TEST_F(SettingsFile, IsRefusedWhenTruncated) {
  save_sample();
  const std::string whole = content();
  // The last two bytes are "}\n": without the newline the text is still complete.
  for (std::size_t size = 0; size + 2 <= whole.size(); ++size) {
    write(whole.substr(0, size));
    expect_refused("truncated");
  }
}

TEST_F(SettingsFile, IsRefusedWhenEditedByHand) {
  save_sample();
  std::string text = content();
  text.replace(text.find("false"), 5, "true");
  write(text);
  expect_refused("checksum");
}

TEST_F(SettingsFile, IsRefusedForAnotherSerialNumber) {
  ASSERT_TRUE(store("t-2").save(Settings{{"filter.on", false}}));
  std::filesystem::copy_file(store("t-2").path(), store().path());
  expect_refused("serial number t-2, and this one is test arm, serial number t-1");
}

TEST_F(SettingsFile, IsRefusedForAnotherModel) {
  const SettingsStore other(folder_.string(), "other arm", "t-1");
  ASSERT_TRUE(other.save({}));
  EXPECT_NE(other.path(), store().path());
  std::filesystem::copy_file(other.path(), store().path());
  expect_refused("it is of the device other arm");
}

TEST_F(SettingsFile, IsRefusedIfItIsNotOne) {
  save_sample();
  write("[1, 2]");
  expect_refused("no settings file");
  write(R"({"format": "rtpm-settings", "format_version": 2})");
  expect_refused("another version");
  write(std::string(100'000, '[') + std::string(100'000, ']'));
  expect_refused("no JSON");
  write(std::string(SettingsStore::kFileSizeMax + 1, ' '));
  expect_refused("larger than");
  std::filesystem::remove(store().path());
  std::filesystem::create_directory(store().path());
  expect_refused("no file");
}

TEST_F(SettingsFile, NamesAndKeepsUnknownParameters) {
  ASSERT_TRUE(store().save(Settings{{"filter.on", false}, {"gone.gain", 2.5}}));
  SettingsStore later = store();
  const auto loaded = later.load(specs_);
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->settings, (Settings{{"filter.on", false}}));
  ASSERT_EQ(loaded->ignored.size(), 1U);
  EXPECT_NE(loaded->ignored[0].find("gone.gain"), std::string::npos);
  ASSERT_TRUE(later.save(Settings{{"filter.on", false}}));
  specs_.push_back(
      {.name = "gone.gain", .type = driver::ParameterType::kReal, .default_value = 1.0});
  EXPECT_EQ(store().load(specs_)->settings, (Settings{{"filter.on", false}, {"gone.gain", 2.5}}));
}

TEST_F(SettingsFile, NamesValuesThatAreNoLongerValid) {
  ASSERT_TRUE(store().save(Settings{{"safety.force_newton_max", 8.0}, {"filter.on", false}}));
  specs_[2].high = 5;
  specs_[2].default_value = 5.0;
  const auto loaded = store().load(specs_);
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->settings, (Settings{{"filter.on", false}}));
  ASSERT_EQ(loaded->ignored.size(), 1U);
  EXPECT_NE(loaded->ignored[0].find("safety.force_newton_max = 8"), std::string::npos);
  EXPECT_NE(loaded->ignored[0].find("0 to 5"), std::string::npos);
}

TEST_F(SettingsFile, IsNamedIfItCannotBeWritten) {
  const SettingsStore nowhere((folder_ / "a" / "b").string(), "test arm", "t-1");
  const auto saved = nowhere.save({});
  ASSERT_FALSE(saved);
  EXPECT_NE(saved.error().text().find(nowhere.path()), std::string::npos);
  EXPECT_FALSE(saved.error().remedy.empty());
}

TEST(SettingsPath, DiffersForDistinctUnits) {
  const auto path = [](const char* model, const char* serial) {
    return SettingsStore("state", model, serial).path();
  };
  EXPECT_EQ(path("RTPM arm", "1-a"), "state/RTPM%20arm@1-a.json");
  EXPECT_NE(path("a@b", "c"), path("a", "b@c"));
  EXPECT_EQ(path("../../etc", "x").find('/', 6), std::string::npos);
}

}  // namespace
}  // namespace rtpm::gvd
