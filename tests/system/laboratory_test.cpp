#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "programs.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::system_test {
namespace {

/// Asks a program to end in order and checks that it does.
void expect_orderly_end(Daemon& daemon) {
  daemon.process.send_signal(SIGTERM);
  const auto end = daemon.process.wait(kPatience);
  ASSERT_TRUE(end) << daemon.url << " did not end on SIGTERM";
  EXPECT_EQ(end->exit_code, 0) << end->errors;
}

TEST_F(Laboratory, AForceLoopDrivesTheArmThatItFoundByItsName) {
  const auto end = run_servo({"--seconds", "2"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {"p50", "p99.99", "max", "missed"});
  expect_orderly_end(*device_);
  expect_orderly_end(*registry_);
}

TEST_F(Laboratory, TheArmRendersAWallInItsOwnLoop) {
  const auto end = run_servo({"--seconds", "3", "--render", "local", "--stiffness", "500"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {"500 N/m, rendered in the device's loop: felt as"});
  EXPECT_EQ(end.output.find("one call: command"), std::string::npos) << end.output;
}

TEST_F(Laboratory, AForceLoopWithALocalWallLearnsThatItLostTheArm) {
  test::Process servo({path_of("rtpm-servo"), "--registry", registry_->url, "--realtime", "off",
                       "--live", "lines", "--seconds", "60", "--render", "local"});
  ASSERT_TRUE(servo.wait_for_output(" mm ", kPatience)) << servo.errors();
  const auto taken = rtpm({"take-over", "lab/arm0", "--for", "500ms"});
  EXPECT_EQ(taken.exit_code, 0) << taken.errors;
  const auto end = servo.wait(kPatience);
  ASSERT_TRUE(end) << "it goes on without the lease";
  expect_one_sentence(*end, 3, {"lab/arm0", "an operator took the lease over"});
}

TEST_F(Laboratory, AToolWithoutGeneratedCodeCallsDeviceAndRegistry) {
  const auto read = rtpm({"call", "lab/arm0", "read"});
  EXPECT_EQ(read.exit_code, 0) << read.errors;
  EXPECT_NE(read.output.find("position"), std::string::npos) << read.output;
  const auto described = rtpm({"info", registry_->url, "--schema"});
  EXPECT_EQ(described.exit_code, 0) << described.errors;
  EXPECT_NE(described.output.find("rpc_service Names"), std::string::npos) << described.output;
  const auto resolved = rtpm({"call", registry_->url, "resolve", "{name: \"lab/arm0\"}"});
  EXPECT_EQ(resolved.exit_code, 0) << resolved.errors;
  EXPECT_NE(resolved.output.find(device_->url), std::string::npos) << resolved.output;
}

TEST_F(Laboratory, ARecordedHandMovesTheArm) {
  const auto file = std::filesystem::path(testing::TempDir()) / "rtpm_hand.csv";
  std::ofstream(file) << "t_s,x_m,y_m,z_m\n0,0,0,0.02\n0.5,0.01,0,-0.01\n1,0,0.01,0.02\n";
  const auto device =
      start_server("rtpm-deviced", {"--devices", "arm1", "--device-arm1-hand", file.string()});
  ASSERT_TRUE(device);
  EXPECT_EQ(run_servo({"--seconds", "1", "--device", "lab/arm1"}).exit_code, 0);
  std::filesystem::remove(file);
}

TEST_F(Laboratory, AClientKilledInMidCallLeavesTheServerServing) {
  // The device drops a silent client when its lease is over, so a successor may have to ask again.
  for (int i = 0; i < 3; ++i) {
    auto victim = start_servo(60);
    ASSERT_TRUE(victim);
    victim->send_signal(SIGKILL);
    ASSERT_TRUE(victim->wait(kPatience));
    const auto successor = run_servo_until_it_succeeds();
    EXPECT_EQ(successor.exit_code, 0) << successor.errors;
  }
}

TEST_F(Laboratory, AnOperatorTakesTheArmFromAForceLoopThatLearnsWhy) {
  auto servo = start_servo(60);
  ASSERT_TRUE(servo);
  expect_one_sentence(rtpm({"take-over", "lab/arm0", "--priority", "27999"}), 1,
                      {"lab/arm0", "28000", "--priority"});
  EXPECT_FALSE(servo->wait(std::chrono::milliseconds{300})) << "nothing has changed for the loop";

  const auto taken = rtpm({"take-over", "lab/arm0", "--for", "500ms"});
  EXPECT_EQ(taken.exit_code, 0) << taken.errors;
  expect_text(taken.output, {"was taken over", "given back"});
  const auto end = servo->wait(kPatience);
  ASSERT_TRUE(end) << "it goes on without the right to command";
  expect_one_sentence(*end, 3, {"lab/arm0", "an operator took the lease over"});
  EXPECT_TRUE(device_->process.wait_for_errors("a call of priority 28000", kPatience));
  const auto successor = run_servo({"--seconds", "0.2"});
  EXPECT_EQ(successor.exit_code, 0) << successor.errors;
}

TEST_F(Laboratory, ADeviceFreesItselfOfAClientThatOnlyHoldsIt) {
  const auto device = start_server(
      "rtpm-deviced",
      {"--folder", "lab", "--devices", "arm1", "--lease-idle", "1s", "--operator-priority", "5"});
  ASSERT_TRUE(device);
  rpc::Node node({.default_deadline = std::chrono::seconds{10}});
  auto holder = gvd::DeviceClient::open(node, device->url);
  ASSERT_TRUE(holder) << holder.error().text();
  ASSERT_TRUE(holder->acquire());
  EXPECT_TRUE(test::await([&] { return !holder->renew(); }, kPatience));
  EXPECT_EQ(*holder->lease_state(), gvd::LeaseState::kIdle);
  const auto taken = rtpm({"take-over", "lab/arm1", "--priority", "5", "--for", "1500ms"});
  EXPECT_EQ(taken.exit_code, 0) << "an operator is never idle: " << taken.errors;
  EXPECT_NE(taken.output.find("given back"), std::string::npos) << taken.output;
  EXPECT_EQ(run_servo({"--seconds", "0.2", "--device", "lab/arm1"}).exit_code, 0);
}

TEST_F(Laboratory, ALostDeviceEndsTheLoopWithTheReason) {
  auto servo = start_servo(60);
  ASSERT_TRUE(servo);
  device_->process.send_signal(SIGKILL);
  const auto end = servo->wait(kPatience);
  ASSERT_TRUE(end) << "it goes on without its device";
  expect_one_sentence(*end, 3, {"lab/arm0"});
}

TEST_F(Laboratory, LoopsOutliveTheRegistryAndNamesComeBack) {
  auto servo = start_servo(2);
  ASSERT_TRUE(servo);
  const std::string port = std::to_string(registry_->port());
  registry_->process.send_signal(SIGKILL);
  ASSERT_TRUE(registry_->process.wait(kPatience));
  const auto end = servo->wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;

  registry_ = start_daemon("rtpm-registryd", {"--port", port, "--realtime", "off"});
  ASSERT_TRUE(registry_);
  // The new registry is empty; the device binds its name again by itself.
  const auto later = run_servo_until_it_succeeds();
  EXPECT_EQ(later.exit_code, 0) << later.errors;
}

TEST_F(Laboratory, GarbageAtItsPortDoesNotStopAServer) {
  const int handle = socket(AF_INET, SOCK_DGRAM, 0);
  ASSERT_GE(handle, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(device_->port());
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::mt19937 random(7);
  std::array<unsigned char, 1500> bytes{};
  for (int i = 0; i < 2000; ++i) {
    for (auto& byte : bytes)
      byte = static_cast<unsigned char>(random());
    const std::size_t size = random() % bytes.size();
    sendto(handle, bytes.data(), size, 0, reinterpret_cast<const sockaddr*>(&address),
           sizeof address);
  }
  close(handle);
  const auto end = run_servo({"--seconds", "1"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
}

}  // namespace
}  // namespace rtpm::system_test
