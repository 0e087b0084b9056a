#include "rtpm/device_serial/frames.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <span>

#include "../../../devices/serial/firmware/rtpm_board/rtpm_frames.h"
#include "rtpm/base/hash.hpp"
#include "vectors.hpp"

/// The frames of devices/serial/FRAMES.md, as host and firmware implement them.
namespace rtpm::device_serial {
namespace {

using test::vectors::bytes;
using Bytes = std::vector<std::byte>;
using Buffer = std::array<std::byte, kFrameSizeMax>;

struct Taken {
  std::vector<std::pair<FrameType, Bytes>> frames;
  std::vector<FrameFault> faults;
};

Taken push(FrameCutter& cutter, ConstBytes wire) {
  Taken taken;
  cutter.push(wire, [&](const expected<Frame, FrameFault>& frame) {
    if (frame) {
      taken.frames.push_back({frame->type, {frame->payload.begin(), frame->payload.end()}});
    } else {
      taken.faults.push_back(frame.error());
    }
  });
  return taken;
}

Bytes encoded(const Frame& frame) {
  Bytes wire(kWireSizeMax);
  wire.resize(encode(frame, wire));
  return wire;
}

/// Encodes the given frame bytes, to which it appends a valid checksum.
Bytes with_checksum(Bytes frame) {
  Bytes checksum(4);
  store_le(checksum.data(), crc32(frame));
  frame.insert(frame.end(), checksum.begin(), checksum.end());
  // COBS for fewer than 254 bytes.
  Bytes wire{std::byte{0}};
  std::size_t code_at = 0;
  for (const std::byte byte : frame) {
    wire.push_back(byte);
    if (byte != std::byte{0}) continue;
    wire[code_at] = static_cast<std::byte>(wire.size() - 1 - code_at);
    code_at = wire.size() - 1;
  }
  wire[code_at] = static_cast<std::byte>(wire.size() - code_at);
  return wire;
}

Bytes payload_of(std::size_t size, std::mt19937_64& random) {
  Bytes payload(size);
  for (std::byte& byte : payload)
    byte = random() % 3 == 0 ? std::byte{0} : static_cast<std::byte>(random());
  return payload;
}

TEST(SerialFrames, ChecksumIsThatOfZlib) {
  const std::string_view text = "123456789";
  EXPECT_EQ(crc32(std::as_bytes(std::span(text))), 0xcbf43926U);
  std::array<std::uint8_t, 9> same{};
  std::memcpy(same.data(), text.data(), same.size());
  EXPECT_EQ(rtpm_board::crc32(same.data(), same.size()), 0xcbf43926U);
}

TEST(SerialFrames, AreAsInTheTestVectors) {
  Bytes nonce(4);
  store_le(nonce.data(), std::uint32_t{0x12345678});
  EXPECT_EQ(encoded({FrameType::kHello, 1, nonce}), bytes(test::vectors::kHello));
  FrameCutter cutter;
  const Taken taken = push(cutter, bytes(test::vectors::kHello));
  ASSERT_EQ(taken.frames.size(), 1u);
  EXPECT_EQ(taken.frames[0], std::pair(FrameType::kHello, nonce));
}

/// Lengths around the ends of COBS groups, with few, many and no zeros.
TEST(SerialFrames, ComeBackAsTheyWereOfEveryLength) {
  std::mt19937_64 random(7);
  FrameCutter cutter;
  for (std::size_t size = 0; size <= kPayloadSizeMax; ++size) {
    Bytes payload = payload_of(size, random);
    if (size % 3 == 1) payload.assign(size, std::byte{0xaa});
    if (size % 3 == 2) payload.assign(size, std::byte{0});
    const Bytes wire = encoded({FrameType::kState, static_cast<std::uint16_t>(size), payload});
    ASSERT_EQ(std::ranges::count(wire, std::byte{0}), 1) << "its delimiter only";
    const Taken taken = push(cutter, wire);
    ASSERT_EQ(taken.frames.size(), 1u) << size;
    ASSERT_EQ(taken.frames[0].second, payload) << size;
  }
  EXPECT_TRUE(encoded({FrameType::kState, 0, Bytes(kPayloadSizeMax + 1)}).empty());
}

/// The host reads frames that the firmware writes, and the reverse.
TEST(SerialFrames, AreTheSameForHostAndFirmware) {
  std::mt19937_64 random(9);
  rtpm_board::Reader reader;
  rtpm_board::Writer writer;
  for (std::size_t size = 0; size <= RTPM_PAYLOAD_SIZE_MAX; ++size) {
    const Bytes payload = payload_of(size, random);
    const auto sequence = static_cast<std::uint16_t>(random());
    writer.begin(rtpm_board::kState, sequence);
    for (const std::byte byte : payload)
      writer.u8(std::to_integer<std::uint8_t>(byte));
    const std::size_t wire_size = writer.finish();
    const Bytes wire = encoded({FrameType::kState, sequence, payload});
    ASSERT_TRUE(std::ranges::equal(std::as_bytes(std::span(writer.wire(), wire_size)), wire));
    int frame_count = 0;
    for (const std::byte byte : wire)
      frame_count += reader.take(std::to_integer<std::uint8_t>(byte)) == rtpm_board::Reader::kFrame;
    ASSERT_EQ(frame_count, 1);
    ASSERT_EQ(reader.sequence(), sequence);
    ASSERT_EQ(reader.payload_size(), size);
    ASSERT_TRUE(std::ranges::equal(std::as_bytes(std::span(reader.payload(), size)), payload));
  }
  writer.begin(rtpm_board::kState, 0);
  for (std::size_t i = 0; i <= RTPM_PAYLOAD_SIZE_MAX; ++i)
    writer.u8(1);
  EXPECT_EQ(writer.finish(), 0u) << "a frame that does not fit is not sent";
}

TEST(SerialFrames, AreDroppedWithAnyBitFlipped) {
  const Bytes state = bytes(test::vectors::kState);
  for (std::size_t bit = 0; bit < 8 * (state.size() - 1); ++bit) {
    Bytes wire = state;
    wire[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    FrameCutter cutter;
    const Taken taken = push(cutter, wire);
    EXPECT_TRUE(taken.frames.empty()) << "bit " << bit;
    EXPECT_FALSE(taken.faults.empty()) << "bit " << bit;
    EXPECT_EQ(push(cutter, state).frames.size(), 1u) << "the next one is in step again";
    rtpm_board::Reader reader;
    for (const std::byte byte : wire)
      EXPECT_NE(reader.take(std::to_integer<std::uint8_t>(byte)), rtpm_board::Reader::kFrame);
  }
}

TEST(SerialFrames, LoseAtMostTheNextOneWhenCutOff) {
  const Bytes state = bytes(test::vectors::kState);
  for (std::size_t size = 1; size < state.size() - 1; ++size) {
    FrameCutter cutter;
    EXPECT_TRUE(push(cutter, ConstBytes(state).first(size)).frames.empty());
    EXPECT_EQ(push(cutter, state).faults.size(), 1u) << size;
    EXPECT_EQ(push(cutter, state).frames.size(), 1u) << size;
  }
}

TEST(SerialFrames, SayWhatIsWrong) {
  const auto fault_of = [](ConstBytes stuffed) {
    Buffer buffer{};
    const auto frame = decode(stuffed, buffer);
    return frame ? std::nullopt : std::optional(frame.error());
  };
  const auto frame = [](std::string_view hex) { return with_checksum(bytes(hex)); };
  EXPECT_EQ(fault_of(frame("01 04 02 00 01 00 aa")), std::nullopt);
  EXPECT_EQ(fault_of(frame("02 04 02 00 01 00 aa")), FrameFault::kVersion);
  EXPECT_EQ(fault_of(frame("00 04 02 00 01 00 aa")), FrameFault::kVersion);
  EXPECT_EQ(fault_of(frame("01 05 02 00 01 00 aa")), FrameFault::kType);
  EXPECT_EQ(fault_of(frame("01 00 02 00 01 00 aa")), FrameFault::kType);
  EXPECT_EQ(fault_of(frame("01 04 02 00 02 00 aa")), FrameFault::kLength);
  EXPECT_EQ(fault_of(frame("01 04 02 00 00 00 aa")), FrameFault::kLength);
  EXPECT_EQ(fault_of(frame("01 04 02 00 01")), FrameFault::kShort);
  EXPECT_EQ(fault_of(bytes("05 01")), FrameFault::kStuffing);
  EXPECT_EQ(fault_of({}), FrameFault::kStuffing);
  EXPECT_EQ(fault_of(bytes("01 01 01 01 01 01 01 01 01 01 01 01")), FrameFault::kChecksum);
}

TEST(SerialFrames, AreDroppedAloneIfTooLong) {
  FrameCutter cutter;
  EXPECT_TRUE(push(cutter, Bytes(100'000, std::byte{0xff})).faults.empty());
  const Bytes end(1, std::byte{0});
  EXPECT_EQ(push(cutter, end).faults, std::vector{FrameFault::kStuffing});
  EXPECT_EQ(push(cutter, bytes(test::vectors::kHello)).frames.size(), 1u);
  rtpm_board::Reader reader;
  for (int i = 0; i < 100'000; ++i)
    ASSERT_EQ(reader.take(0xff), rtpm_board::Reader::kNothing);
  EXPECT_EQ(reader.take(0), rtpm_board::Reader::kBad);
}

}  // namespace
}  // namespace rtpm::device_serial
