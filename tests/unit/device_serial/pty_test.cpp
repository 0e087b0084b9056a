#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <future>
#include <memory>

#include "pty_board.hpp"
#include "rtpm/device_serial/open.hpp"
#include "rtpm/device_serial/ports.hpp"
#include "rtpm/device_serial/serial_driver.hpp"
#include "rtpm/rt/clock.hpp"

/// The driver on libserialport and a pseudo terminal, in real time.
namespace rtpm::device_serial {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;
using std::chrono::milliseconds;
using test::PtyBoard;
using test::SerialFault;
using test::SerialModel;

constexpr Duration kPeriod = milliseconds{2};

std::unique_ptr<SerialDriver> make_driver(PortSettings port, ListPorts list = &list_ports,
                                          Duration greeting_max = milliseconds{400}) {
  return std::make_unique<SerialDriver>(SerialConfig{.open = open_serial_port(std::move(list)),
                                                     .port = std::move(port),
                                                     .board = fallback_board(),
                                                     .serial = "A",
                                                     .frame = "paddle0/base",
                                                     .greeting_max = greeting_max,
                                                     .realtime = rt::RealtimeMode::kOff});
}

bool start(driver::Driver& driver) {
  return driver.configure({.period = kPeriod}) && driver.activate();
}

/// The results of a run of cycles.
struct Cycles {
  int ok_count = 0;
  ExchangeStatus last = ExchangeStatus::kLate;
  double greatest_effort = 0;
  driver::Sample sample{};
};

/// Runs cycles on schedule until `span` is over or the board is gone, which must be within 5 s.
Cycles run(driver::Driver& driver, Duration span, double newton_metre) {
  Cycles cycles;
  MonotonicTime due = rt::now();
  for (const MonotonicTime end = due + span; due < end; due += kPeriod) {
    rt::sleep_until(due);
    driver::Command command;
    command.mode = CommandMode::kJointEffort;
    command.cycle_time = rt::now();
    command.deadline = command.cycle_time + milliseconds{50};
    command.joints[0] = newton_metre;
    command.outputs[0] = 1;
    cycles.sample.faults = {};
    cycles.last = driver.exchange(command, cycles.sample);
    cycles.ok_count += cycles.last == ExchangeStatus::kOk ? 1 : 0;
    cycles.greatest_effort =
        std::max(cycles.greatest_effort, std::abs(cycles.sample.efforts_applied[0]));
    if (cycles.last == ExchangeStatus::kGone) break;
  }
  return cycles;
}

float effort_of(PtyBoard& board) {
  float effort = 0;
  board.with([&](SerialModel& model) { effort = model.effort(); });
  return effort;
}

TEST(SerialPty, CarriesCommandsAndStates) {
  PtyBoard board;
  const auto driver = make_driver({.port = board.port()});
  const auto configured = driver->configure({.period = kPeriod});
  ASSERT_TRUE(configured) << configured.error().text();
  ASSERT_TRUE(driver->activate());
  const Cycles cycles = run(*driver, milliseconds{100}, 0.1);
  EXPECT_EQ(cycles.last, ExchangeStatus::kOk);
  EXPECT_NEAR(cycles.sample.joints[0], 0.1, 1e-6);
  EXPECT_NEAR(cycles.sample.efforts_applied[0], 0.1, 1e-6);
  EXPECT_EQ(cycles.sample.outputs_applied[0], 1);
  EXPECT_EQ(effort_of(board), 0.1F);
  EXPECT_EQ(driver->counters().corrupt, 0u);
  driver->deactivate();
  EXPECT_EQ(effort_of(board), 0);
}

TEST(SerialPty, WaitsForABoardThatOpeningResets) {
  PtyBoard board(SerialFault::kNone, 0, true);
  board.with([](SerialModel& model) { model.set_boot_time(milliseconds{150}); });
  const auto driver = make_driver({.port = board.port()}, &list_ports, milliseconds{3000});
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(start(*driver));
    EXPECT_GT(run(*driver, milliseconds{40}, 0.1).ok_count, 0);
    driver->deactivate();
  }
}

TEST(SerialPty, RefusesAPathThatIsNotAPort) {
  const auto why = [](const std::string& port) {
    const auto configured = make_driver({.port = port})->configure({.period = kPeriod});
    return configured ? "" : configured.error().text();
  };
  EXPECT_NE(why("/dev/ttyNone").find("plug the board in"), std::string::npos);
  EXPECT_NE(why("/dev/null").find("no serial port"), std::string::npos) << why("/dev/null");
  const std::string file = testing::TempDir() + "rtpm_no_port";
  std::ofstream{file} << "text";
  EXPECT_NE(why(file).find("no serial port"), std::string::npos) << why(file);
  const PtyBoard silent(SerialFault::kDeaf);
  EXPECT_NE(why(silent.port()).find("does not answer"), std::string::npos) << why(silent.port());
}

TEST(SerialPty, SaysWhichRightIsMissing) {
  if (::geteuid() == 0) GTEST_SKIP() << "root has every right; run as a user";
  const PtyBoard board;
  std::filesystem::permissions(board.port(), std::filesystem::perms::none);
  const auto configured = make_driver({.port = board.port()})->configure({.period = kPeriod});
  ASSERT_FALSE(configured);
  EXPECT_NE(configured.error().text().find("dialout"), std::string::npos)
      << configured.error().text();
}

TEST(SerialPty, APortIsForOneProgram) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may open a port that is in use; run as a user";
  PtyBoard board;
  const auto driver = make_driver({.port = board.port()});
  ASSERT_TRUE(start(*driver));
  const auto second = make_driver({.port = board.port()})->configure({.period = kPeriod});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("other program"), std::string::npos);
}

/// The board comes back at another node.
TEST(SerialPty, IsFoundAgainByItsSerialNumber) {
  std::vector<Port> ports;
  auto board = std::make_unique<PtyBoard>();
  const auto listed = [](const PtyBoard& at) {
    return Port{.node = at.port(), .is_usb = true, .serial = "U1"};
  };
  ports = {listed(*board)};
  const auto driver = make_driver({.serial = "U1"}, [&ports] { return ports; });
  ASSERT_TRUE(start(*driver));
  EXPECT_GT(run(*driver, milliseconds{40}, 0.1).ok_count, 0);
  board->unplug();
  EXPECT_EQ(run(*driver, milliseconds{500}, 0.1).last, ExchangeStatus::kGone);
  driver->deactivate();
  ports.clear();
  const auto absent = driver->configure({.period = kPeriod});
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.error().text().find("U1 is not plugged in"), std::string::npos);
  board = std::make_unique<PtyBoard>();
  const PtyBoard twin;
  ports = {listed(*board), listed(twin)};
  const auto ambiguous = driver->configure({.period = kPeriod});
  ASSERT_FALSE(ambiguous);
  EXPECT_NE(ambiguous.error().text().find("2 ports"), std::string::npos);
  ports = {listed(*board)};
  ASSERT_TRUE(start(*driver));
  EXPECT_GT(run(*driver, milliseconds{40}, 0.1).ok_count, 0);
}

/// The faults with which a session starts and goes on.
bool is_survived(SerialFault fault) {
  switch (fault) {
    case SerialFault::kNoise:
    case SerialFault::kSplit:
    case SerialFault::kGlued:
    case SerialFault::kDuplicate:
    case SerialFault::kStale:
    case SerialFault::kLost:
    case SerialFault::kLate:
    case SerialFault::kHalfStuck:
      return true;
    default:
      return false;
  }
}

/// The outcome of one fault.
struct Finding {
  SerialFault fault;
  bool is_started = false;
  bool comes_to_rest = false;
  Cycles cycles{};
};

Finding find(SerialFault fault, std::uint64_t faulty_from) {
  Finding finding{.fault = fault};
  PtyBoard board(fault, faulty_from);
  board.with([](SerialModel& model) { model.set_boot_time(milliseconds{100}); });
  const auto driver = make_driver({.port = board.port()});
  // On a machine that stalls, the server would try again, too.
  const int attempt_count = is_survived(fault) ? 3 : 1;
  for (int i = 0; i < attempt_count && !finding.is_started; ++i)
    finding.is_started = start(*driver);
  const Duration span = milliseconds{is_survived(fault) || faulty_from == 0 ? 400 : 5000};
  if (finding.is_started) finding.cycles = run(*driver, span, 0.1);
  driver->deactivate();
  finding.comes_to_rest = board.comes_to_rest();
  return finding;
}

class SerialPtyFaults : public ::testing::TestWithParam<std::uint64_t> {};

/// Every fault starting at this frame, each on its own terminal and all at the same time.
TEST_P(SerialPtyFaults, EndInZeroEffort) {
  std::vector<std::future<Finding>> findings;
  for (int i = 1; i <= static_cast<int>(test::kLastSerialFault); ++i)
    findings.push_back(
        std::async(std::launch::async, find, static_cast<SerialFault>(i), GetParam()));
  for (auto& future : findings) {
    const Finding finding = future.get();
    SCOPED_TRACE(to_string(finding.fault));
    EXPECT_TRUE(finding.comes_to_rest);
    EXPECT_LE(finding.cycles.greatest_effort, 0.1 + 1e-6);
    const bool is_gone = finding.is_started && finding.cycles.last == ExchangeStatus::kGone;
    const bool is_reset =
        finding.fault == SerialFault::kReset || finding.fault == SerialFault::kResetUnnoticed;
    if (is_survived(finding.fault)) {
      EXPECT_TRUE(finding.is_started && !is_gone);
      EXPECT_TRUE(finding.cycles.ok_count > 0 || finding.fault == SerialFault::kLate);
    } else if (GetParam() > 0 || !is_reset) {  // A reset at the hello delays the greeting.
      EXPECT_TRUE(!finding.is_started || is_gone);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(FromFrame, SerialPtyFaults, ::testing::Values(0, 1, 20));

}  // namespace
}  // namespace rtpm::device_serial
