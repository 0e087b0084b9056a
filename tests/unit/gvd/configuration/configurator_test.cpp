#include "configurator.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "rtpm/test/temporary_folder.hpp"
#include "samples.hpp"

// Transactions and calibrations of a device that the test simulates, on a simulated time line.
namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Settings = std::vector<ParameterSetting>;
using Names = std::vector<std::string>;
using enum ConfigurationOutcome;

struct Recorder final : ParameterListener {
  void on_change(std::uint64_t revision, std::span<const std::string> names) override {
    revisions.push_back(revision);
    changed.insert(changed.end(), names.begin(), names.end());
  }
  std::vector<std::uint64_t> revisions{};
  Names changed{};
};

class ConfiguratorTest : public testing::Test {
 protected:
  [[nodiscard]] Configurator make(std::optional<SettingsStore> store = {}) {
    return {device_, *ParameterTable::create(device_.specs), std::move(store), &recorder_};
  }
  [[nodiscard]] driver::ParameterValue on_device(const std::string& name) const {
    for (const ParameterSetting& setting : device_.values) {
      if (setting.name == name) return setting.value;
    }
    return {};
  }

  test::SampleDevice device_{};
  Recorder recorder_{};
};

TEST_F(ConfiguratorTest, AppliesAllAndReadsBack) {
  Configurator configurator = make();
  device_.read_back = [](ParameterSetting& setting) {
    if (setting.name == "safety.force_newton_max") setting.value = 4.5;
  };
  const auto applied =
      configurator.apply(1, {{"filter.on", false}, {"safety.force_newton_max", 4.51}});
  ASSERT_TRUE(applied) << applied.error().words.text();
  EXPECT_EQ(applied->revision, 2U);
  EXPECT_EQ(applied->settings[1].value, driver::ParameterValue(4.5)) << "as the device took it";
  EXPECT_EQ(configurator.settings({})->settings[2].value, driver::ParameterValue(4.5));
  EXPECT_EQ(recorder_.revisions, std::vector<std::uint64_t>{2});
  EXPECT_EQ(recorder_.changed, (Names{"filter.on", "safety.force_newton_max"}));
  EXPECT_TRUE(configurator.snapshot().is_unsaved);
}

TEST_F(ConfiguratorTest, AppliesNothingWhenOneIsRefused) {
  Configurator configurator = make();
  EXPECT_EQ(configurator.apply(1, {{"filter.on", false}, {"safety.force_newton_max", 99.0}})
                .error()
                .outcome,
            kOutOfRange);
  EXPECT_EQ(device_.apply_count, 0) << "the device never saw it";
  device_.error = {kRefusedByDevice, "filter.on", {"the filter can't be off", "", "leave it on"}};
  const auto refused = configurator.apply(1, {{"filter.on", false}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, kRefusedByDevice);
  EXPECT_EQ(refused.error().words.what, "the filter can't be off");
  EXPECT_EQ(configurator.revision(), 1U);
  EXPECT_EQ(configurator.settings({})->settings[0].value, driver::ParameterValue(true));
  EXPECT_TRUE(recorder_.revisions.empty());
}

TEST_F(ConfiguratorTest, TheDeviceDecidesWhetherItIsActive) {
  Configurator configurator = make();
  const Settings offset{{"encoder.offset_m", std::vector<double>{0.01, 0, 0}}};
  device_.active = true;
  EXPECT_EQ(configurator.apply(1, offset).error().outcome, kWrongState);
  EXPECT_EQ(device_.apply_count, 0);
  EXPECT_TRUE(configurator.apply(1, {{"filter.on", false}})) << "this one may change at any time";
  device_.active = false;
  EXPECT_TRUE(configurator.apply(2, offset));
}

TEST_F(ConfiguratorTest, ResetsToDefaults) {
  Configurator configurator = make();
  ASSERT_TRUE(configurator.apply(1, {{"filter.on", false}, {"filter.taps", std::int64_t{2}}}));
  ASSERT_TRUE(configurator.reset(2, Names{"filter.on"}));
  EXPECT_EQ(on_device("filter.on"), driver::ParameterValue(true));
  EXPECT_EQ(on_device("filter.taps"), driver::ParameterValue(std::int64_t{2}));
  ASSERT_TRUE(configurator.reset(3, {}));
  EXPECT_EQ(on_device("filter.taps"), driver::ParameterValue(std::int64_t{8}));
  EXPECT_EQ(configurator.reset(3, {}).error().outcome, kStaleRevision);
}

TEST_F(ConfiguratorTest, SavesAndLoads) {
  const test::TemporaryFolder folder;
  const auto store = [&] { return SettingsStore(folder.path(), "test arm", "t-1"); };
  {
    Configurator configurator = make(store());
    ASSERT_TRUE(configurator.apply(1, {{"filter.on", false}, {"safety.force_newton_max", 2.0}}));
    ASSERT_TRUE(configurator.save());
    EXPECT_FALSE(configurator.snapshot().is_unsaved);
  }
  device_.specs[2].high = 1;  // The device now has a lower limit.
  device_.specs[2].default_value = 1.0;
  Configurator configurator = make(store());
  const auto ignored = configurator.load();
  ASSERT_TRUE(ignored) << ignored.error().text();
  ASSERT_EQ(ignored->size(), 1U);
  EXPECT_EQ(configurator.settings({})->settings[0].value, driver::ParameterValue(false));
  EXPECT_EQ(configurator.settings({})->settings[2].value, driver::ParameterValue(1.0));
  EXPECT_FALSE(configurator.snapshot().is_unsaved);
}

class CalibrationTest : public ConfiguratorTest {
 protected:
  CalibrationTest() { device_.active = true; }

  /// One more sample at `x_m`, 10 ms later.
  void sample(double x_m) {
    now_ += milliseconds{10};
    driver::Sample sample;
    sample.sequence = ++sequence_;
    sample.lifecycle = driver::Lifecycle::kActive;
    sample.pose.position_m.x = x_m;
    device_.sample = sample;
    configurator_.step(now_);
  }
  void samples(double x_m, int count = test::MeanCalibration::kSampleCount) {
    for (int i = 0; i < count; ++i) {
      sample(x_m);
    }
  }
  [[nodiscard]] CalibrationStatus status(std::uint64_t run) {
    const auto status = configurator_.calibration(run, now_);
    EXPECT_TRUE(status);
    return status.value_or(CalibrationStatus{});
  }
  [[nodiscard]] std::uint64_t start() {
    sample(0);
    const auto started = configurator_.calibrate("offset", now_);
    EXPECT_TRUE(started);
    return started ? started->run : 0;
  }
  /// Starts a calibration and answers until it has a result; returns its run.
  [[nodiscard]] std::uint64_t finish() {
    const std::uint64_t run = start();
    EXPECT_TRUE(configurator_.answer(run, 1, "ready", now_));
    samples(0.02);
    EXPECT_TRUE(configurator_.answer(run, 2, "ready", now_));
    samples(0.04);
    return run;
  }

  MonotonicTime now_{seconds{100}};
  std::uint64_t sequence_ = 0;
  Configurator configurator_ = make();
};

TEST_F(CalibrationTest, GoesThroughItsDialogueAndIsKept) {
  const std::uint64_t run = start();
  CalibrationStatus seen = status(run);
  EXPECT_EQ(seen.phase, CalibrationPhase::kPrompt);
  EXPECT_EQ(seen.prompt, 1U);
  EXPECT_EQ(seen.text, "hold still");
  EXPECT_EQ(seen.answers, (Names{"ready", "abort"}));
  samples(0);
  EXPECT_EQ(status(run).prompt, 1U) << "the same prompt, sample after sample";
  ASSERT_TRUE(configurator_.answer(run, 1, "ready", now_));
  sample(0.02);
  EXPECT_EQ(status(run).phase, CalibrationPhase::kRunning);
  EXPECT_DOUBLE_EQ(status(run).progress, 0.25);
  samples(0.02, 2);
  EXPECT_EQ(status(run).prompt, 2U) << "another prompt of the same words";
  ASSERT_TRUE(configurator_.answer(run, 2, "ready", now_));
  samples(0.04);
  seen = status(run);
  EXPECT_EQ(seen.phase, CalibrationPhase::kDone);
  EXPECT_EQ(seen.text, "found it");
  ASSERT_EQ(seen.settings.size(), 1U);
  EXPECT_NEAR(std::get<std::vector<double>>(seen.settings[0].value)[0], 0.03, 1e-12);
  EXPECT_EQ(device_.apply_count, 0) << "nothing changes before keep";

  EXPECT_EQ(configurator_.keep(run, now_).error().outcome, kWrongState)
      << "this parameter changes while the device is inactive only";
  device_.active = false;
  const auto kept = configurator_.keep(run, now_);
  ASSERT_TRUE(kept) << kept.error().words.text();
  EXPECT_EQ(kept->phase, CalibrationPhase::kKept);
  EXPECT_EQ(recorder_.changed, Names{"encoder.offset_m"});
  EXPECT_EQ(configurator_.open_run(), 0U);
  EXPECT_EQ(configurator_.keep(run, now_).error().outcome, kNoResult);
}

TEST_F(CalibrationTest, AnAnswerToAnEarlierPromptIsNotTakenForTheNext) {
  const std::uint64_t run = start();
  ASSERT_TRUE(configurator_.answer(run, 1, "ready", now_));
  EXPECT_EQ(configurator_.answer(run, 1, "ready", now_).error().outcome, kWrongAnswer)
      << "it was answered already";
  samples(0);
  ASSERT_EQ(status(run).prompt, 2U);
  EXPECT_EQ(configurator_.answer(run, 1, "ready", now_).error().outcome, kWrongAnswer);
  const auto unknown = configurator_.answer(run, 2, "later", now_);
  EXPECT_EQ(unknown.error().outcome, kWrongAnswer);
  EXPECT_NE(unknown.error().words.remedy.find("ready or abort"), std::string::npos);
  EXPECT_EQ(status(run).phase, CalibrationPhase::kPrompt);
}

TEST_F(CalibrationTest, LeftHalfwayIsDiscardedAndChangesNothing) {
  const std::uint64_t run = start();
  ASSERT_TRUE(configurator_.answer(run, 1, "ready", now_));
  const Settings before = device_.values;
  // Samples continue, but no client asks.
  const MonotonicTime left = now_;
  while (now_ < left + CalibrationRun::kSilenceMax) {
    EXPECT_EQ(configurator_.open_run(), run);
    sample(0.02);
  }
  EXPECT_EQ(configurator_.open_run(), 0U);
  EXPECT_EQ(status(run).phase, CalibrationPhase::kDiscarded);
  EXPECT_NE(status(run).text.find("no client"), std::string::npos);
  EXPECT_EQ(configurator_.keep(run, now_).error().outcome, kNoResult);
  EXPECT_EQ(device_.values, before);
  EXPECT_TRUE(configurator_.calibrate("offset", now_)) << "another can start";
}

TEST_F(CalibrationTest, AResultThatIsNotKeptIsDiscarded) {
  const std::uint64_t run = finish();
  now_ += CalibrationRun::kSilenceMax;
  EXPECT_EQ(configurator_.keep(run, now_).error().outcome, kNoResult) << "too late";
  EXPECT_EQ(status(run).phase, CalibrationPhase::kDiscarded);
  EXPECT_EQ(device_.apply_count, 0);
}

TEST_F(CalibrationTest, QuestionsKeepItAlive) {
  const std::uint64_t run = start();
  for (int i = 0; i < 4; ++i) {
    now_ += CalibrationRun::kSilenceMax - seconds{1};
    sample(0);
    EXPECT_EQ(status(run).phase, CalibrationPhase::kPrompt);
  }
}

TEST_F(CalibrationTest, IsCancelledAtAnyTime) {
  const std::uint64_t run = start();
  const auto discarded = configurator_.discard(run, now_);
  ASSERT_TRUE(discarded);
  EXPECT_EQ(discarded->phase, CalibrationPhase::kDiscarded);
  const std::uint64_t second = finish();
  EXPECT_EQ(configurator_.discard(second, now_)->phase, CalibrationPhase::kDiscarded);
  EXPECT_TRUE(configurator_.discard(second, now_)->settings.empty());
  EXPECT_EQ(device_.apply_count, 0);
}

TEST_F(CalibrationTest, FailsWithTheReason) {
  const std::uint64_t run = start();
  ASSERT_TRUE(configurator_.answer(run, 1, "abort", now_));
  sample(0);
  EXPECT_EQ(status(run).phase, CalibrationPhase::kFailed);
  EXPECT_EQ(status(run).text, "the operator gave up; begin again");
  EXPECT_EQ(configurator_.open_run(), 0U);
}

TEST_F(CalibrationTest, FailsWithoutSamplesOfAnActiveDevice) {
  const std::uint64_t run = start();
  ASSERT_TRUE(configurator_.answer(run, 1, "ready", now_));
  const MonotonicTime last = now_;
  while (now_ < last + CalibrationRun::kNoSampleMax) {
    ASSERT_EQ(status(run).phase, CalibrationPhase::kPrompt);
    // The inactive device keeps publishing its last sample.
    driver::Sample sample = *device_.sample;
    sample.sequence = ++sequence_;
    sample.lifecycle = driver::Lifecycle::kInactive;
    device_.sample = sample;
    now_ += milliseconds{100};
    configurator_.step(now_);
  }
  EXPECT_EQ(status(run).phase, CalibrationPhase::kFailed);
  EXPECT_NE(status(run).text.find("activate"), std::string::npos);
}

TEST_F(CalibrationTest, ResultsOfOtherParametersAreNotKept) {
  const std::uint64_t run = finish();
  ASSERT_TRUE(configurator_.apply(configurator_.revision(), {{"filter.on", false}}));
  device_.active = false;
  const auto kept = configurator_.keep(run, now_);
  ASSERT_FALSE(kept);
  EXPECT_EQ(kept.error().outcome, kStaleRevision);
  EXPECT_EQ(kept.error().words.remedy, "calibrate again");
}

TEST_F(CalibrationTest, OneRunsAtATime) {
  const std::uint64_t run = start();
  EXPECT_EQ(configurator_.calibrate("offset", now_).error().outcome, kBusy);
  EXPECT_EQ(configurator_.open_run(), run);
  EXPECT_EQ(configurator_.calibrate("gain", now_).error().outcome, kUnknownCalibration);
  EXPECT_EQ(configurator_.calibration(run + 1, now_).error().outcome, kNoSuchRun);
}

}  // namespace
}  // namespace rtpm::gvd
