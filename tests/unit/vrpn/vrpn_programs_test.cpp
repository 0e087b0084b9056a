#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>

#include "rtpm/device_vrpn/vrpn_driver.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/free_port.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/process.hpp"
#include "served.hpp"

// Beside VRPN's own programs, built from its sources.
namespace rtpm::vrpn {
namespace {

using namespace std::chrono_literals;

TEST(RtpmVrpn, ServesTheDevicesOfThisHost) {
  const std::string folder = RTPM_PROGRAM_FOLDER "/";
  rtpm::test::Process devices({folder + "rtpm-deviced"});
  ASSERT_TRUE(devices.wait_for_output("serving lab/arm0", 20s)) << devices.errors();
  rtpm::test::Process server({folder + "rtpm-vrpn", "--port", "0"});
  ASSERT_TRUE(server.wait_for_output("\n", 20s)) << server.errors();
  constexpr std::string_view kBefore = "serving lab/arm0@127.0.0.1:";
  ASSERT_TRUE(server.output().starts_with(kBefore)) << server.output();
  const int port = std::stoi(server.output().substr(kBefore.size()));
  device_vrpn::VrpnDriver driver({.port = static_cast<std::uint16_t>(port), .tracker = "lab/arm0"},
                                 "s", "f");
  const auto configured = driver.configure({.period = 10ms});
  ASSERT_TRUE(configured) << configured.error().text();
  ASSERT_TRUE(driver.activate());
  driver::Command command;
  driver::Sample first;
  driver::Sample sample;
  command.cycle_time = rt::now();
  ASSERT_EQ(driver.exchange(command, first), driver::ExchangeStatus::kOk);
  EXPECT_TRUE(rtpm::test::await([&] {
    command.cycle_time = rt::now();
    static_cast<void>(driver.exchange(command, sample));
    return sample.pose.position_m != first.pose.position_m;
  })) << "the simulated hand moves";
  server.send_signal(SIGTERM);
  const auto end = server.wait(20s);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_NE(end->output.find("1 clients, 0 refused"), std::string::npos) << end->output;
}

class VrpnPrograms : public testing::Test {
 protected:
  void SetUp() override {
    const char* const folder = std::getenv("RTPM_VRPN_PROGRAMS");
    if (folder == nullptr) {
      GTEST_SKIP() << "needs VRPN's programs: build https://github.com/vrpn/vrpn, and let "
                      "RTPM_VRPN_PROGRAMS name a folder with vrpn_print_devices and vrpn_server";
    }
    folder_ = folder;
    folder_ += "/";
  }
  std::string folder_;
};

TEST_F(VrpnPrograms, PrintTheServedDevices) {
  test::Served served;
  const std::string device = "Arm0@127.0.0.1:" + std::to_string(served.port());
  rtpm::test::Process print({"stdbuf", "-oL", folder_ + "vrpn_print_devices", device});
  driver::Sample sample = test::full_sample();
  EXPECT_TRUE(print.wait_for_output("pos", 20s)) << print.output() << print.errors();
  sample.button_edges = {1, 0};
  sample.buttons = 1;
  served.set(sample);
  for (const char* words : {"pos ( 0.25, -0.50,  0.12)", "quat ( 0.00,  0.00,  0.60,  0.80)",
                            "0.75,  0.50 (2 chans)", "number 0 was just pressed"})
    EXPECT_TRUE(print.wait_for_output(words, 20s)) << words << print.output() << print.errors();
}

TEST_F(VrpnPrograms, ServeATrackerToTheDriver) {
  const std::uint16_t port = rtpm::test::free_port();
  const std::string file = testing::TempDir() + "vrpn_test_" + std::to_string(getpid()) + ".cfg";
  std::ofstream(file) << "vrpn_Tracker_NULL Tracker0 2 50.0\n";
  rtpm::test::Process server({folder_ + "vrpn_server", "-f", file, std::to_string(port)});
  device_vrpn::VrpnDriver driver({.port = port, .sensor = 1}, "s", "f");
  ASSERT_TRUE(rtpm::test::await([&] { return driver.configure({.period = 10ms}).has_value(); }))
      << server.errors();
  ASSERT_TRUE(driver.activate());
  driver::Command command;
  driver::Sample sample;
  command.cycle_time = rt::now();
  EXPECT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kOk);
  EXPECT_EQ(sample.pose.orientation, driver::Quaternion{});
}

}  // namespace
}  // namespace rtpm::vrpn
