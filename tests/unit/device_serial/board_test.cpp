#include "rtpm/device_serial/board.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "rtpm/device_serial/frames.hpp"
#include "rtpm/device_serial/open.hpp"
#include "vectors.hpp"

/// The contents of frames.
namespace rtpm::device_serial {
namespace {

using test::vectors::bytes;
using Bytes = std::vector<std::byte>;

constexpr BoardShape kPaddle{1, 2, 1, 1};

Bytes payload_of(std::string_view vector) {
  const Bytes wire = bytes(vector);
  std::array<std::byte, kFrameSizeMax> buffer{};
  const auto frame = decode(ConstBytes(wire).first(wire.size() - 1), buffer);
  EXPECT_TRUE(frame);
  return frame ? Bytes(frame->payload.begin(), frame->payload.end()) : Bytes{};
}

/// Builds descriptions of all kinds.
class Description {
 public:
  Description& u8(unsigned value) {
    bytes_.push_back(static_cast<std::byte>(value));
    return *this;
  }
  Description& u16(unsigned value) { return u8(value & 0xff).u8(value >> 8); }
  Description& number(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    return u16(bits & 0xffff).u16(bits >> 16);
  }
  Description& text(std::string_view value) {
    u8(static_cast<unsigned>(value.size()));
    for (const char c : value)
      u8(static_cast<unsigned char>(c));
    return *this;
  }
  /// Nonce, rate, name and serial number.
  static Description head(unsigned rate_hz = 100) {
    return Description().u16(1).u16(0).u16(rate_hz).text("board").text("");
  }
  [[nodiscard]] const Bytes& get() const { return bytes_; }
  [[nodiscard]] std::string fault() const {
    const auto board = parse_description(bytes_);
    return board ? "" : board.error();
  }

 private:
  Bytes bytes_;
};

TEST(SerialBoard, DescribesItselfAsInTheTestVector) {
  const auto board = parse_description(payload_of(test::vectors::kDescription));
  ASSERT_TRUE(board) << board.error();
  EXPECT_EQ(board->nonce, 0x12345678u);
  EXPECT_EQ(board->name, "RTPM paddle");
  EXPECT_EQ(board->serial, "PADDLE-1");
  EXPECT_TRUE(board->has_channels_of(fallback_board())) << "of the firmware in this tree";
  EXPECT_EQ(board->outputs[0].safe, 0);
  BoardDescription other = *board;
  other.joints[0].effort_max = 1;
  EXPECT_FALSE(board->has_channels_of(other));
}

TEST(SerialBoard, RefusesDescriptionsOfAWrongLength) {
  Bytes payload = payload_of(test::vectors::kDescription);
  for (std::size_t size = 0; size < payload.size(); ++size) {
    const auto board = parse_description(ConstBytes(payload).first(size));
    ASSERT_FALSE(board) << size;
    EXPECT_FALSE(board.error().empty());
  }
  payload.push_back(std::byte{0});
  EXPECT_EQ(parse_description(payload).error(), "bytes follow its end");
}

TEST(SerialBoard, RefusesDescriptionsWithTheReason) {
  const auto head = [] { return Description::head(); };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(head().u8(0).u8(0).u8(0).u8(0).fault(), "") << "a board may have nothing";
  EXPECT_NE(Description::head(0).u8(0).u8(0).u8(0).u8(0).fault().find("rate"), std::string::npos);
  EXPECT_NE(Description::head(5000).u8(0).u8(0).u8(0).u8(0).fault().find("rate"),
            std::string::npos);
  EXPECT_NE(head().u8(9).fault().find("too many joints"), std::string::npos);
  EXPECT_NE(head().u8(0).u8(9).fault().find("too many analogs"), std::string::npos);
  EXPECT_NE(head().u8(0).u8(0).u8(17).fault().find("too many buttons"), std::string::npos);
  EXPECT_NE(head().u8(0).u8(0).u8(0).u8(9).fault().find("too many outputs"), std::string::npos);
  const auto joint = [&](unsigned unit, float low, float high, float effort) {
    return head()
        .u8(1)
        .text("j")
        .u8(unit)
        .number(low)
        .number(high)
        .number(effort)
        .u8(0)
        .u8(0)
        .u8(0)
        .fault();
  };
  EXPECT_EQ(joint(1, 0, 0, 0), "");
  EXPECT_NE(joint(2, 0, 1, 1).find("unit"), std::string::npos);
  EXPECT_NE(joint(0, 1, 0, 1).find("range"), std::string::npos);
  EXPECT_NE(joint(0, kNan, 0, 1).find("range"), std::string::npos);
  EXPECT_NE(joint(0, 0, 1, -1).find("effort"), std::string::npos);
  EXPECT_NE(joint(0, 0, 1, kNan).find("effort"), std::string::npos);
  EXPECT_NE(joint(0, 0, 1, 1e9F).find("effort"), std::string::npos);
  EXPECT_NE(head().u8(0).u8(0).u8(1).text("").u8(0).fault().find("name"), std::string::npos);
  EXPECT_NE(head().u8(0).u8(0).u8(1).text("a\x1b[2J").u8(0).fault().find("name"),
            std::string::npos);
  EXPECT_NE(head().u8(0).u8(0).u8(1).text(std::string(32, 'x')).u8(0).fault().find("name"),
            std::string::npos);
  EXPECT_NE(
      head().u8(0).u8(0).u8(0).u8(1).text("o").text("1").number(0).number(1).number(2).fault().find(
          "safe"),
      std::string::npos);
}

TEST(SerialBoard, StatesItsValuesAsInTheTestVector) {
  const auto state = parse_state(payload_of(test::vectors::kState), kPaddle);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->answered, 2);
  EXPECT_EQ(state->time_us, 1'000'000u);
  EXPECT_EQ(state->buttons, 1);
  EXPECT_EQ(state->positions[0], 0.25F);
  EXPECT_EQ(state->velocities[0], -1.5F);
  EXPECT_EQ(state->efforts[0], 0.0625F);
  EXPECT_EQ(state->analogs[1], 0.5F);
  EXPECT_EQ(state->outputs[0], 1.0F);
}

TEST(SerialBoard, RefusesStatesOfAnotherSizeOrWithImpossibleValues) {
  const Bytes payload = payload_of(test::vectors::kState);
  for (std::size_t size = 0; size < payload.size(); ++size)
    EXPECT_FALSE(parse_state(ConstBytes(payload).first(size), kPaddle)) << size;
  EXPECT_FALSE(parse_state(payload, {1, 2, 1, 0})) << "too long";
  EXPECT_FALSE(parse_state(payload, {1, 2, 0, 1})) << "a button that it does not have";
  Bytes status = payload;
  status[2] = std::byte{4};
  EXPECT_FALSE(parse_state(status, kPaddle)) << "a status that this version does not have";
  for (std::size_t at = 10; at < payload.size(); at += 4) {
    for (const std::uint32_t bits : {0x7fc00000U, 0x7f800000U, 0xff800000U}) {
      Bytes wrong = payload;
      store_le(wrong.data() + at, bits);
      EXPECT_FALSE(parse_state(wrong, kPaddle)) << at;
    }
  }
}

TEST(SerialBoard, EncodesCommandsAsInTheTestVectors) {
  Bytes payload(kCommandSizeMax);
  BoardCommand command{.is_on = true, .watchdog_ms = 30};
  command.efforts[0] = 0.0625F;
  command.outputs[0] = 1;
  payload.resize(write_command(command, kPaddle, payload));
  EXPECT_EQ(payload, payload_of(test::vectors::kCommand));
  Bytes off(kCommandSizeMax);
  off.resize(write_command({}, kPaddle, off));
  EXPECT_EQ(off, payload_of(test::vectors::kOff));
}

}  // namespace
}  // namespace rtpm::device_serial
