#include <gtest/gtest.h>

#include <algorithm>

#include "arduino.hpp"
#include "rtpm/device_serial/open.hpp"
#include "rtpm/device_serial/session.hpp"

// The sketch is compiled with fewer warnings than this tree.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"
#include "../../../devices/serial/firmware/rtpm_board/rtpm_board.ino"
#pragma GCC diagnostic pop

/// The sketch itself with the host's session, on a simulated time line.
namespace rtpm::device_serial {
namespace {

using std::chrono::milliseconds;
using test::fake_arduino;

constexpr std::uint8_t kMotor = 5;
constexpr std::uint8_t kDirection = 8;
constexpr std::uint8_t kLamp = 9;
constexpr std::uint8_t kButton = 2;

/// Runs the sketch's loop() while the host waits.
class SketchPort final : public Transport {
 public:
  [[nodiscard]] Transferred send(ConstBytes bytes) override {
    for (const std::byte byte : bytes)
      fake_arduino.received.push_back(std::to_integer<std::uint8_t>(byte));
    return {bytes.size(), false};
  }
  [[nodiscard]] Transferred receive(MutableBytes buffer, Duration) override {
    fake_arduino.time_us += 500;
    loop();
    std::vector<std::byte>& sent = fake_arduino.sent;
    const std::size_t size = std::min(sent.size(), buffer.size());
    std::copy_n(sent.begin(), size, buffer.begin());
    sent.erase(sent.begin(), sent.begin() + static_cast<std::ptrdiff_t>(size));
    return {size, false};
  }
  void wake() noexcept override {}
  [[nodiscard]] MonotonicTime now() const override {
    return MonotonicTime{std::chrono::microseconds{fake_arduino.time_us}};
  }
};

class SerialSketch : public ::testing::Test {
 protected:
  void SetUp() override {
    fake_arduino.levels.at(kButton) = HIGH;
    fake_arduino.levels.at(A2) = 512;
    setup();
    const auto board = session_.greet();
    ASSERT_TRUE(board) << board.error().text();
    board_ = *board;
    session_.begin();
  }
  void run(Request request, Duration span) {
    const MonotonicTime end = port_.now() + span;
    while (port_.now() < end) {
      request.number = ++number_;
      ASSERT_TRUE(session_.step(request, milliseconds{1}));
    }
  }
  static Request request_for(float newton_metre, float lamp) {
    Request request{.is_on = true, .time_left = milliseconds{30}};
    request.efforts[0] = newton_metre;
    request.outputs[0] = lamp;
    return request;
  }

  SketchPort port_;
  Session session_{port_, {.period = milliseconds{2}, .nonce = 5}};
  BoardDescription board_;
  std::uint64_t number_ = 0;
};

TEST_F(SerialSketch, IsTheDriversDefaultBoard) {
  EXPECT_TRUE(board_.has_channels_of(fallback_board()));
  EXPECT_EQ(board_.name, fallback_board().name);
  EXPECT_EQ(fake_arduino.speed_baud, PortSettings{}.speed_baud);
  EXPECT_TRUE(fake_arduino.is_output.at(kMotor));
}

TEST_F(SerialSketch, DrivesTheMotorAsCommanded) {
  run(request_for(0.0625F, 1), milliseconds{20});
  EXPECT_EQ(fake_arduino.written.at(kMotor), 127);
  EXPECT_EQ(fake_arduino.written.at(kDirection), HIGH);
  EXPECT_EQ(fake_arduino.written.at(kLamp), 255);
  EXPECT_FALSE(session_.report().state.is_saturated);
  run(request_for(-100, 0), milliseconds{20});
  EXPECT_EQ(fake_arduino.written.at(kMotor), 255) << "no more than full duty";
  EXPECT_EQ(fake_arduino.written.at(kDirection), LOW);
  EXPECT_TRUE(session_.report().state.is_saturated);
  EXPECT_EQ(session_.report().state.efforts[0], -0.125F);
  session_.stop();
  EXPECT_EQ(fake_arduino.written.at(kMotor), 0);
}

TEST_F(SerialSketch, MeasuresItsChannels) {
  fake_arduino.levels.at(A3) = 1023;
  fake_arduino.levels.at(kButton) = LOW;
  for (int i = 0; i < 50; ++i) {
    fake_arduino.levels.at(A2) += 2;
    run({}, milliseconds{1});
  }
  const BoardState state = session_.report().state;
  EXPECT_NEAR(state.positions[0], 0.0015 * 100, 0.01);
  EXPECT_NEAR(state.velocities[0], 0.0015 * 2000, 0.3);
  EXPECT_EQ(state.analogs[0], 1);
  EXPECT_EQ(state.analogs[1], 0);
  EXPECT_EQ(state.buttons, 1);
}

TEST_F(SerialSketch, SwitchesOffByItselfWithoutAHost) {
  run(request_for(0.1F, 1), milliseconds{20});
  EXPECT_GT(fake_arduino.written.at(kMotor), 0);
  for (int i = 0; i < 35; ++i) {
    fake_arduino.time_us += 1000;
    loop();
  }
  EXPECT_EQ(fake_arduino.written.at(kMotor), 0);
  EXPECT_EQ(fake_arduino.written.at(kLamp), 0);
  run({}, milliseconds{5});
  EXPECT_EQ(session_.report().state.efforts[0], 0);
}

TEST_F(SerialSketch, IgnoresCommandsWithoutAHelloAndRepeatedOnes) {
  run(request_for(0.1F, 1), milliseconds{20});
  session_.stop();
  std::array<std::byte, kWireSizeMax> wire{};
  std::array<std::byte, kCommandSizeMax> payload{};
  BoardCommand command{.is_on = true, .watchdog_ms = 100};
  command.efforts[0] = 0.1F;
  const std::size_t payload_size = write_command(command, board_.shape(), payload);
  // The session has used this sequence before.
  const std::size_t size =
      encode({FrameType::kCommand, 2, ConstBytes(payload).first(payload_size)}, wire);
  static_cast<void>(port_.send(ConstBytes(wire).first(size)));
  loop();
  EXPECT_EQ(fake_arduino.written.at(kMotor), 0);
}

}  // namespace
}  // namespace rtpm::device_serial
