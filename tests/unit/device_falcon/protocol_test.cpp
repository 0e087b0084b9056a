#include "rtpm/device_falcon/protocol.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::device_falcon {
namespace {

std::vector<std::byte> bytes_of(std::string_view text) {
  std::vector<std::byte> bytes;
  for (const char letter : text)
    bytes.push_back(static_cast<std::byte>(letter));
  return bytes;
}
std::string text_of(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes)
    text += static_cast<char>(byte);
  return text;
}

/// The reports in `text`, identified by their first count.
std::vector<int> first_counts(PacketParser& parser, std::string_view text) {
  std::vector<int> found;
  parser.push(bytes_of(text),
              [&](const EncoderReport& report) { found.push_back(report.counts[0]); });
  return found;
}

constexpr std::string_view kOne = "<BAAAAAAAAAAAAA>";
constexpr std::string_view kTwo = "<CAAAAAAAAAAAAA>";

TEST(FalconPacket, CodesCountsAsInTheReference) {
  EXPECT_EQ(text_of(encode(MotorRequest{.counts = {1447, -1447, -1}})), "<HKFAJFKPPPPPAA>");
  EXPECT_EQ(text_of(encode(MotorRequest{.counts = {4095, 0, 1}, .flags = kHomingFlag})),
            "<PPPAAAAABAAABA>");
  EXPECT_EQ(text_of(encode(EncoderReport{.counts = {-4096, 0, 0}, .buttons = 5, .homed = 7})),
            std::string("<AAAPAAAAAAAA") + static_cast<char>(0x41 + 0x75) + "A>");
}

TEST(FalconPacket, CutsCountsBeyondAMotorsRange) {
  EXPECT_EQ(encode(MotorRequest{.counts = {32767, -32768, 4096}}),
            encode(MotorRequest{.counts = {4095, -4095, 4095}}));
}

TEST(FalconPacket, DecodesEncodedReports) {
  for (int count = -32768; count <= 32767; count += 7) {
    const auto value = static_cast<std::int16_t>(count);
    const EncoderReport report{.counts = {value, 0, value},
                               .buttons = static_cast<std::uint8_t>(count & 0xf),
                               .homed = static_cast<std::uint8_t>(count >> 4 & 7)};
    const auto read = decode_report(encode(report));
    ASSERT_TRUE(read);
    ASSERT_EQ(read->counts, report.counts);
    ASSERT_EQ(read->buttons, report.buttons);
    ASSERT_EQ(read->homed, report.homed);
  }
}

TEST(FalconPacket, RefusesEachByteOutOfItsRange) {
  for (std::size_t i = 0; i < kPacketSize; ++i) {
    for (int value = 0; value < 256; ++value) {
      Packet packet = encode(EncoderReport{});
      packet[i] = static_cast<std::byte>(value);
      const bool is_mark = value == '<' || value == '>';
      bool may_stand = value >= 0x41 && value <= 0x50;
      if (i == 0) may_stand = value == '<';
      if (i == 13) may_stand = value >= 0x41 && value <= 0xc0;
      if (i == 14) may_stand = !is_mark;
      if (i == 15) may_stand = value == '>';
      ASSERT_EQ(decode_report(packet).has_value(), may_stand) << "byte " << i << " = " << value;
    }
  }
}

TEST(FalconParser, FindsTheNextPacketAfterAShortOne) {
  for (std::size_t size = 1; size < kPacketSize; ++size) {
    PacketParser parser;
    EXPECT_EQ(first_counts(parser, std::string(kOne.substr(0, size)) + std::string(kTwo)),
              (std::vector<int>{2}))
        << size;
    EXPECT_EQ(parser.corrupt_count(), 1u) << size;
  }
}

TEST(FalconParser, CountsARunOfForeignBytesOnce) {
  PacketParser parser;
  EXPECT_EQ(first_counts(parser, "garbage>>" + std::string(kOne) + "\x01\x60" + std::string(kTwo)),
            (std::vector<int>{1, 2}));
  EXPECT_EQ(parser.corrupt_count(), 2u);
}

TEST(FalconParser, LosesNoPacketButTheDamagedOne) {
  for (std::size_t i = 0; i < kPacketSize; ++i) {
    for (const char damage : {'\0', '<', '>', 'Q', '\xff'}) {
      std::string damaged(kOne);
      if (damaged[i] == damage) continue;
      damaged[i] = damage;
      PacketParser parser;
      const auto found = first_counts(parser, damaged + std::string(kTwo) + std::string(kTwo));
      const bool is_unseen = i == 13 || i == 14;
      ASSERT_GE(std::ranges::count(found, 2), is_unseen && damage == '<' ? 1 : 2)
          << i << " " << int{damage};
    }
  }
}

TEST(FtdiStatus, IsRemovedFromEachUsbPacketAndNotOnlyFromTheFirst) {
  std::string transfer =
      "\x01\x60" + std::string(62, 'a') + "\x01\x60" + std::string(62, 'b') + "\x01\x60" + "cc";
  std::vector<std::byte> bytes = bytes_of(transfer);
  const std::size_t size = strip_status(bytes);
  EXPECT_EQ(text_of(std::span(bytes).first(size)),
            std::string(62, 'a') + std::string(62, 'b') + "cc");
}

TEST(FtdiStatus, HasNoPayloadAlone) {
  for (const std::size_t size : {0u, 1u, 2u}) {
    std::vector<std::byte> bytes(size);
    EXPECT_EQ(strip_status(bytes), 0u);
  }
  std::vector<std::byte> full_then_status(66);
  EXPECT_EQ(strip_status(full_then_status), 62u);
}

}  // namespace
}  // namespace rtpm::device_falcon
