#include "reading/reflection.hpp"

#include <flatbuffers/idl.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace rtpm::schema {
namespace {

constexpr const char* kText =
    "namespace lab; table Request { x:int; }\n"
    "rpc_service Arm { call(Request):Request; }\n";

std::vector<std::uint8_t> reflection_bytes() {
  flatbuffers::IDLOptions options;
  options.project_root = "/";
  flatbuffers::Parser parser(options);
  EXPECT_TRUE(parser.Parse(kText, nullptr, "/lab/arm.fbs")) << parser.error_;
  parser.Serialize();
  const std::uint8_t* bytes = parser.builder_.GetBufferPointer();
  return {bytes, bytes + parser.builder_.GetSize()};
}

constexpr const char* kFile = "//lab/arm.fbs";

// A .bfbs is untrusted: whatever its content, reading ends without a crash.
TEST(Reflection, DamagedBytesAreRefusedOrRead) {
  const std::vector<std::uint8_t> good = reflection_bytes();
  int refused = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const unsigned flip : {0x01u, 0x80u, 0xFFu}) {
      std::vector<std::uint8_t> bad = good;
      bad[i] = static_cast<std::uint8_t>(bad[i] ^ flip);
      if (!read_reflection(bad, kFile)) ++refused;
    }
  }
  EXPECT_GT(refused, 0);
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(read_reflection({good.data(), size}, kFile) && size < 16) << size;
  }
}

}  // namespace
}  // namespace rtpm::schema
