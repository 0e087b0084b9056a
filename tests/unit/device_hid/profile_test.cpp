#include "rtpm/device_hid/profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <numbers>
#include <vector>

#include "hid_game_pad_model.hpp"
#include "hid_open_ff_board_model.hpp"
#include "hid_sony_pad_model.hpp"
#include "hid_space_mouse_model.hpp"
#include "rtpm/device_hid/session.hpp"
#include "scripted_hid.hpp"

/// Each kind of device with its model, on a simulated time line.
namespace rtpm::device_hid {
namespace {

using std::chrono::milliseconds;
using test::HidModel;

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> result;
  for (const int value : values)
    result.push_back(static_cast<std::byte>(value));
  return result;
}

/// An initialized profile with its model.
struct Bench {
  explicit Bench(std::shared_ptr<HidModel> plugged, double torque = 0)
      : model(plugged), system(test::system_with(std::move(plugged))) {
    const Unit unit = system->units()[0];
    profile = make_profile(kind_of(unit).value(), &unit, torque);
    transport = std::move(*system->open(unit));
    is_begun = profile->begin(*transport, unit).has_value();
    reader.emplace(*transport, *profile, state);
  }
  void run(Duration time) {
    const MonotonicTime end = transport->now() + time;
    while (transport->now() < end)
      ASSERT_TRUE(reader->step(milliseconds{1}));
  }
  bool write(const Request& request) { return transport->write(profile->encode(request).view()); }

  std::shared_ptr<HidModel> model;
  std::shared_ptr<test::ScriptedHidSystem> system;
  std::unique_ptr<Profile> profile;
  std::unique_ptr<HidTransport> transport;
  State state{};
  std::optional<Reader> reader{};
  bool is_begun = false;
};

Verdict take(Profile& profile, State& state, std::initializer_list<int> report) {
  return profile.take(bytes(report), MonotonicTime{}, state);
}

TEST(HidSpaceMouse, ReadsBothLayoutsInItsOwnFrame) {
  for (const auto layout :
       {test::SpaceMouseModel::Layout::kTwoReports, test::SpaceMouseModel::Layout::kOneReport}) {
    Bench bench(std::make_shared<test::SpaceMouseModel>(layout));
    bench.model->move(0, 1);     // To the right.
    bench.model->move(1, 0.5);   // Toward the user.
    bench.model->move(2, -0.2);  // Up.
    bench.model->move(5, 1);     // About the downward axis.
    bench.run(milliseconds{40});
    EXPECT_FLOAT_EQ(bench.state.analogs[0], 0.0014F);
    EXPECT_FLOAT_EQ(bench.state.analogs[1], 0.2F * 0.0014F);
    EXPECT_FLOAT_EQ(bench.state.analogs[2], 0.5F * 0.0014F);
    EXPECT_FLOAT_EQ(bench.state.analogs[4], -1);
    for (int axis = 0; axis < 6; ++axis)
      bench.model->move(axis, 0);
    bench.run(milliseconds{40});
    EXPECT_EQ(bench.state.analogs, decltype(bench.state.analogs){}) << "at rest";
  }
}

TEST(HidSpaceMouse, ReadsRecordedReports) {
  const auto profile = make_profile(Kind::kSpaceMouse, nullptr, 0);
  State state;
  EXPECT_EQ(take(*profile, state, {2, 0, 0, 0xe2, 0xff, 0, 0}), Verdict::kNew);
  EXPECT_FLOAT_EQ(state.analogs[5], -30.0F / 350) << "about the axis to the user";
  EXPECT_EQ(take(*profile, state, {3, 3, 0}), Verdict::kNew);
  EXPECT_EQ(state.buttons, 3u);
  EXPECT_EQ(take(*profile, state, {0x17, 80, 0}), Verdict::kForeign) << "the battery";
  // Caps exceed the stated range when pushed hard.
  EXPECT_EQ(take(*profile, state, {1, 0xff, 0x7f, 0, 0x80, 0, 0}), Verdict::kNew);
  EXPECT_FLOAT_EQ(state.analogs[0], 0.0014F);
  EXPECT_FLOAT_EQ(state.analogs[2], -0.0014F);
}

TEST(HidSpaceMouse, KnowsTheKeysOfAPro) {
  const Unit pro{.vendor = 0x256f, .product = 0xc631};
  const auto profile = make_profile(Kind::kSpaceMouse, &pro, 0);
  ASSERT_EQ(profile->describe().buttons.size(), 15u);
  State state;
  EXPECT_EQ(take(*profile, state, {3, 0x01, 0x10, 0x40, 0x04}), Verdict::kNew);
  std::vector<std::string> pressed;
  for (std::size_t i = 0; i < 15; ++i) {
    if ((state.buttons >> i & 1) != 0) pressed.push_back(profile->describe().buttons[i]);
  }
  EXPECT_EQ(pressed, (std::vector<std::string>{"menu", "1", "escape", "lock"}));
}

/// A SpaceMouse Pro may report keys above the first sixteen bits.
TEST(HidSpaceMouse, KnowsTheKeysOfAProBehindAUniversalReceiver) {
  for (const int product : {0xc652, 0xc633}) {
    const Unit unit{.vendor = 0x256f, .product = static_cast<std::uint16_t>(product)};
    const auto profile = make_profile(Kind::kSpaceMouse, &unit, 0);
    State state;
    EXPECT_EQ(take(*profile, state, {3, 0x03, 0, 0x40, 0x04}), Verdict::kNew);
    EXPECT_EQ(state.buttons, 1u << 0 | 1u << 1 | 1u << 10 | 1u << 14) << product;
    EXPECT_EQ(profile->describe().buttons[14], "lock");
  }
}

TEST(HidSpaceMouse, ReadsTheLongReportOfAnEnterprise) {
  const Unit unit{.vendor = 0x256f, .product = 0xc633};
  const auto profile = make_profile(Kind::kSpaceMouse, &unit, 0);
  State state;
  EXPECT_EQ(take(*profile, state, {3, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}), Verdict::kNew);
  EXPECT_EQ(state.buttons, 1u);
  EXPECT_FALSE(profile->left_out().empty());
}

TEST(HidSpaceMouse, LightsUp) {
  Bench bench(std::make_shared<test::SpaceMouseModel>(test::SpaceMouseModel::Layout::kTwoReports));
  EXPECT_TRUE(bench.write({.outputs = {1}}));
  EXPECT_FALSE(bench.model->is_safe());
  EXPECT_TRUE(bench.write({}));
  EXPECT_TRUE(bench.model->is_safe());
}

TEST(HidGamePad, NamesItsChannelsFromItsDescriptor) {
  Bench bench(std::make_shared<test::GamePadModel>());
  const driver::Descriptor descriptor = bench.profile->describe();
  std::vector<std::string> names;
  for (const driver::Analog& analog : descriptor.analogs)
    names.push_back(analog.name);
  EXPECT_EQ(names, (std::vector<std::string>{"x", "y", "z", "rz", "hat_x", "hat_y"}));
  EXPECT_EQ(descriptor.buttons.size(), 12u);
  EXPECT_EQ(descriptor.buttons[11], "button_12");
  EXPECT_TRUE(descriptor.modes.empty()) << "it only measures";
}

TEST(HidGamePad, ReadsAxesHatAndButtons) {
  const auto model = std::make_shared<test::GamePadModel>();
  Bench bench(model);
  model->move(0, -1);
  model->move(3, 1);
  model->press(11, true);
  bench.run(milliseconds{2});
  EXPECT_EQ(bench.state.analogs[0], -1);
  EXPECT_NEAR(bench.state.analogs[1], 0, 0.01);
  EXPECT_EQ(bench.state.analogs[3], 1);
  EXPECT_EQ(bench.state.analogs[4], 0) << "the null state of the hat";
  EXPECT_EQ(bench.state.buttons, 1u << 11);
  model->set_hat(1);
  bench.run(milliseconds{2});
  EXPECT_EQ(bench.state.analogs[4], 1) << "right";
  EXPECT_EQ(bench.state.analogs[5], -1) << "and away from the user";
}

TEST(HidGamePad, CountsAPressBetweenTwoReads) {
  const auto model = std::make_shared<test::GamePadModel>();
  Bench bench(model);
  for (int i = 0; i < 5; ++i) {
    model->press(2, true);
    model->press(2, false);
  }
  bench.run(milliseconds{2});
  EXPECT_EQ(bench.state.buttons, 0u);
  EXPECT_EQ(bench.state.button_edges[2], 10);
}

TEST(HidGamePad, HasTheUsualChannelsUntilItIsPluggedIn) {
  const auto model = std::make_shared<test::GamePadModel>();
  const auto system = test::system_with(model);
  const auto profile = make_profile(Kind::kGamePad, nullptr, 0);
  EXPECT_EQ(profile->describe().analogs.size(), 8u);
  EXPECT_EQ(profile->describe().buttons.size(), 16u);
  const Unit unit = system->units()[0];
  auto transport = std::move(*system->open(unit));
  ASSERT_TRUE(profile->begin(*transport, unit));
  State state;
  Reader reader(*transport, *profile, state);
  model->move(3, 1);
  ASSERT_TRUE(reader.step(milliseconds{1}));
  EXPECT_EQ(state.analogs[5], 1) << "rz, by its name";
  EXPECT_EQ(state.analogs[3], 0) << "rx, which it lacks";
}

class HidSonyPad : public testing::TestWithParam<std::tuple<Kind, bool>> {
 protected:
  [[nodiscard]] static std::shared_ptr<test::SonyPadModel> make() {
    const auto [kind, is_bluetooth] = GetParam();
    if (kind == Kind::kDualShock4) return std::make_shared<test::DualShock4Model>(is_bluetooth);
    return std::make_shared<test::DualSenseModel>(is_bluetooth);
  }
};

TEST_P(HidSonyPad, ReadsSticksTriggersAndButtons) {
  Bench bench(make());
  ASSERT_TRUE(bench.is_begun);
  bench.model->move(0, -1);
  bench.model->move(3, 1);
  bench.model->move(5, 1);
  bench.model->press(1, true);
  bench.model->press(13, true);
  bench.run(milliseconds{20});
  EXPECT_EQ(bench.state.analogs[0], -1);
  EXPECT_EQ(bench.state.analogs[3], 1);
  EXPECT_EQ(bench.state.analogs[4], 0);
  EXPECT_EQ(bench.state.analogs[5], 1);
  EXPECT_EQ(bench.state.analogs[6], 0) << "the hat's centre";
  EXPECT_EQ(bench.state.buttons, 1u << 1 | 1u << 13);
}

TEST_P(HidSonyPad, CarriesThePadsOwnTimeOverItsEnd) {
  Bench bench(make());
  const MonotonicTime begin = bench.transport->now();
  bench.run(std::chrono::seconds{2});
  const double ratio = std::chrono::duration<double>(bench.state.device_time) /
                       std::chrono::duration<double>(bench.transport->now() - begin);
  EXPECT_NEAR(ratio, 1, 0.01);
}

TEST_P(HidSonyPad, RumblesAndShines) {
  const auto model = make();
  Bench bench(model);
  EXPECT_TRUE(bench.write({.outputs = {1, 0.5, 0.2F, 0, 1}}));
  EXPECT_EQ(model->output(test::SonyPadModel::kStrong), 255);
  EXPECT_EQ(model->output(test::SonyPadModel::kWeak), 128);
  EXPECT_EQ(model->output(test::SonyPadModel::kRed), 51);
  EXPECT_EQ(model->output(test::SonyPadModel::kBlue), 255);
  EXPECT_TRUE(bench.write({}));
  EXPECT_TRUE(model->is_safe());
  const float nan = std::nanf("");
  EXPECT_TRUE(bench.write({.outputs = {nan, -1e30F, nan, nan, nan}}));
  EXPECT_TRUE(model->is_safe());
}

INSTANTIATE_TEST_SUITE_P(Pads, HidSonyPad,
                         testing::Combine(testing::Values(Kind::kDualShock4, Kind::kDualSense),
                                          testing::Bool()));

TEST(HidReader, IgnoresARepeatedReportWhereReportsAreCounted) {
  for (const std::size_t kind : {2u, 3u}) {
    Bench bench(test::make_model(kind));
    bench.run(milliseconds{20});
    bench.system->plugged[0].port->set_fault(test::HidFault::kStale);
    bench.run(milliseconds{200});
    EXPECT_TRUE(bench.reader->is_late());
    EXPECT_EQ(bench.reader->corrupt_count(), 0u);
  }
}

TEST(HidReader, IsNeverLateWithADeviceThatReportsChanges) {
  Bench bench(test::make_model(1));
  bench.run(std::chrono::seconds{3});
  EXPECT_FALSE(bench.reader->is_late());
}

TEST(HidWriter, WritesChangesAndRepeatsUnsafeOutputs) {
  Bench bench(test::make_model(2));
  Writer writer(*bench.transport, *bench.profile, {});
  const auto& port = *bench.system->plugged[0].port;
  const std::uint64_t begin = port.step_count();
  MonotonicTime now{std::chrono::seconds{1}};
  const Request rumble{.outputs = {1}};
  for (int i = 0; i < 100; ++i)
    writer.step(rumble, now += milliseconds{1});
  EXPECT_EQ(port.step_count() - begin, 1u);
  writer.step(rumble, now += Writer::kRepeatPeriod);
  EXPECT_EQ(port.step_count() - begin, 2u);
  writer.step({}, now += milliseconds{1});
  writer.step({}, now += std::chrono::seconds{5});
  EXPECT_EQ(port.step_count() - begin, 3u) << "the safe values once";
  EXPECT_TRUE(bench.model->is_safe());
}

TEST(HidWriter, IsGoneAfterManyRefusals) {
  Bench bench(test::make_model(2));
  Writer writer(*bench.transport, *bench.profile, {});
  bench.system->plugged[0].port->set_fault(test::HidFault::kRefuses);
  MonotonicTime now{std::chrono::seconds{1}};
  writer.step({.outputs = {1}}, now);
  EXPECT_TRUE(writer.is_refused());
  EXPECT_EQ(writer.delivered(), Request{});
  for (int i = 0; i < Writer::kRefusalMax; ++i) {
    EXPECT_FALSE(i + 1 < Writer::kRefusalMax && writer.is_gone());
    writer.step({.outputs = {1}}, now += Writer::kRetryPeriod);
  }
  EXPECT_TRUE(writer.is_gone());
}

TEST(HidOpenFfBoard, ReadsItsWheelInRadian) {
  Bench bench(std::make_shared<test::OpenFfBoardModel>());
  ASSERT_TRUE(bench.is_begun);
  bench.model->move(0, 1);
  bench.model->move(2, -1);
  bench.model->press(3, true);
  bench.run(milliseconds{3});
  EXPECT_NEAR(bench.state.joint, 450 * std::numbers::pi / 180, 1e-3);
  EXPECT_EQ(bench.state.analogs[1], -1);
  EXPECT_EQ(bench.state.buttons, 1u << 3);
}

TEST(HidOpenFfBoard, MeasuresItsVelocity) {
  Bench bench(std::make_shared<test::OpenFfBoardModel>());
  for (int i = 0; i <= 100; ++i) {
    bench.model->move(0, 0.001 * i);
    bench.run(milliseconds{1});
  }
  EXPECT_NEAR(bench.state.joint_velocity, 450 * std::numbers::pi / 180, 0.2);
}

TEST(HidOpenFfBoard, AppliesEffortAsAShareOfItsMotorsTorque) {
  const auto model = std::make_shared<test::OpenFfBoardModel>();
  Bench bench(model, 4);
  ASSERT_TRUE(bench.is_begun);
  EXPECT_EQ(model->effect_count(), 1);
  EXPECT_TRUE(bench.write({.effort = -1}));
  EXPECT_NEAR(model->torque_share(), -0.25, 1e-4);
  for (const double effort : {1e30, 4.0, HUGE_VAL}) {
    EXPECT_TRUE(bench.write({.effort = effort}));
    EXPECT_EQ(model->torque_share(), std::isfinite(effort) ? 1 : 0) << effort;
  }
  EXPECT_TRUE(bench.write({.effort = -1e300}));
  EXPECT_EQ(model->torque_share(), -1) << "no integer wraps";
  bench.profile->end(*bench.transport);
  EXPECT_TRUE(model->is_safe());
  EXPECT_EQ(model->effect_count(), 0);
}

TEST(HidOpenFfBoard, AppliesNoEffortWithoutAKnownTorque) {
  const auto model = std::make_shared<test::OpenFfBoardModel>();
  Bench bench(model, 0);
  EXPECT_TRUE(bench.profile->describe().modes.empty());
  EXPECT_EQ(bench.profile->encode({.effort = 3}).size, 0u);
  EXPECT_EQ(model->effect_count(), 0);
}

TEST(HidOpenFfBoard, EndsTheEffectsOfAKilledDriver) {
  const auto model = std::make_shared<test::OpenFfBoardModel>();
  for (int i = 0; i < 60; ++i) {
    Bench bench(model, 4);
    ASSERT_TRUE(bench.is_begun) << "the board has 40 effects";
    EXPECT_TRUE(model->is_safe());
    EXPECT_TRUE(bench.write({.effort = 4}));
  }
}

}  // namespace
}  // namespace rtpm::device_hid
