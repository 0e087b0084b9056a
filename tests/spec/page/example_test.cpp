// The worked example of spec/hprotocol.md#hp-15, read from that page: the code must write and read
// exactly these bytes.

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::wire {
namespace {

// The bytes of the block that begins with "```hex <name>".
std::vector<std::byte> bytes_of_example(const std::string& name) {
  std::ifstream page(RTPM_SPEC_DIR "/hprotocol.md");
  std::vector<std::byte> bytes;
  std::string line;
  bool is_inside = false;
  while (std::getline(page, line)) {
    if (line == "```hex " + name) {
      is_inside = true;
    } else if (line == "```") {
      is_inside = false;
    } else if (is_inside) {
      std::istringstream words(line);
      for (unsigned value = 0; words >> std::hex >> value;) {
        bytes.push_back(static_cast<std::byte>(value));
      }
    }
  }
  return bytes;
}

TEST(SpecExample, DecodesTheCall) {
  const auto frame = bytes_of_example("call");
  ASSERT_EQ(frame.size(), 112U);
  const auto header = decode_frame(frame);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->kind, FrameKind::kCall);
  EXPECT_EQ(header->priority, Priority{24000});
  EXPECT_EQ(header->session, 0xb7fc5e0b78510000ULL);
  EXPECT_EQ(header->call_id, 1U);
  EXPECT_EQ(header->service, 1U);
  EXPECT_EQ(header->method, 2U);
  EXPECT_EQ(header->payload_size, 48U);
  EXPECT_EQ(header->budget_us, 800U);
  EXPECT_EQ(header->sender_time_ns, 1'000'050'000U);
  double last = 0;
  std::memcpy(&last, frame.data() + frame.size() - sizeof last, sizeof last);
  EXPECT_EQ(last, -0.5);
}

TEST(SpecExample, EncodesTheSameBytes) {
  for (const char* name : {"call", "reply"}) {
    const auto frame = bytes_of_example(name);
    ASSERT_GE(frame.size(), kHeaderSize);
    const auto header = decode_frame(frame);
    ASSERT_TRUE(header) << name;
    std::array<std::byte, kHeaderSize> encoded{};
    encode(*header, encoded.data());
    EXPECT_TRUE(std::equal(encoded.begin(), encoded.end(), frame.begin())) << name;
  }
}

TEST(SpecExample, DecodesTheReply) {
  const auto header = decode_frame(bytes_of_example("reply"));
  ASSERT_TRUE(header);
  EXPECT_EQ(header->kind, FrameKind::kReply);
  EXPECT_EQ(header->status, Status::kOk);
  EXPECT_EQ(header->payload_size, 0U);
  EXPECT_EQ(header->budget_us, 10U);
}

}  // namespace
}  // namespace rtpm::wire
