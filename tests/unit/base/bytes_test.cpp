#include "rtpm/base/bytes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>

namespace rtpm {
namespace {

std::array<std::byte, 8> counting_bytes() {
  std::array<std::byte, 8> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::byte>(i + 1);
  return bytes;
}

TEST(Bytes, StoresLittleEndianNumbersWithoutAlignment) {
  std::array<std::byte, 16> bytes{};
  for (std::size_t offset = 0; offset < 8; ++offset) {
    store_le<std::uint64_t>(bytes.data() + offset, 0xfedcba9876543210ull);
    EXPECT_EQ(load_le<std::uint64_t>(bytes.data() + offset), 0xfedcba9876543210ull);
    EXPECT_EQ(bytes[offset], std::byte{0x10});
  }
}

TEST(ByteReader, TakesFieldsInOrder) {
  const auto bytes = counting_bytes();
  ByteReader reader(bytes);
  EXPECT_EQ(reader.take<std::uint8_t>(), 0x01);
  EXPECT_EQ(reader.take<std::uint16_t>(), 0x0302);
  EXPECT_EQ(reader.left(), 5u);
  EXPECT_EQ(reader.take_bytes(5).data(), bytes.data() + 3);
  EXPECT_EQ(reader.left(), 0u);
  EXPECT_TRUE(reader.ok());
}

TEST(ByteReader, FailsForGoodPastTheEnd) {
  const auto bytes = counting_bytes();
  ByteReader reader(ConstBytes(bytes).first(3));
  EXPECT_EQ(reader.take<std::uint32_t>(), 0u);
  EXPECT_FALSE(reader.ok());
  EXPECT_EQ(reader.take<std::uint16_t>(), 0x0201) << "what is there can still be read";
  EXPECT_FALSE(reader.ok()) << "but the failure stays";
}

TEST(ByteReader, RefusesACountThatWouldWrapAround) {
  const auto bytes = counting_bytes();
  ByteReader reader(bytes);
  EXPECT_EQ(reader.take<std::uint8_t>(), 0x01);
  EXPECT_TRUE(reader.take_bytes(SIZE_MAX).empty());
  EXPECT_FALSE(reader.ok());
}

TEST(ByteReader, RefusesTextThatIsLongerThanTheBytes) {
  std::array<std::byte, 4> bytes{};
  store_le<std::uint16_t>(bytes.data(), 3);
  ByteReader reader(bytes);
  EXPECT_EQ(reader.take_text(), "");
  EXPECT_FALSE(reader.ok());
}

TEST(ByteWriter, WritesTheFieldsThatAReaderTakes) {
  std::array<std::byte, 32> bytes{};
  ByteWriter writer(bytes);
  writer.put<std::uint16_t>(0xabcd);
  writer.put_text("force");
  writer.put_zeros(3);
  writer.put<std::uint64_t>(42);
  ASSERT_TRUE(writer.ok());
  EXPECT_EQ(writer.size(), 2u + 2 + 5 + 3 + 8);
  EXPECT_EQ(writer.left(), bytes.size() - writer.size());

  ByteReader reader(ConstBytes(bytes).first(writer.size()));
  EXPECT_EQ(reader.take<std::uint16_t>(), 0xabcd);
  EXPECT_EQ(reader.take_text(), "force");
  for (const std::byte zero : reader.take_bytes(3))
    EXPECT_EQ(zero, std::byte{0});
  EXPECT_EQ(reader.take<std::uint64_t>(), 42u);
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.left(), 0u);
}

TEST(ByteWriter, WritesNothingPastTheEndAndFailsForGood) {
  std::array<std::byte, 4> bytes{};
  bytes[3] = std::byte{0x5a};
  ByteWriter writer(MutableBytes(bytes).first(3));
  writer.put<std::uint32_t>(0xffffffff);
  EXPECT_FALSE(writer.ok());
  writer.put<std::uint8_t>(1);
  EXPECT_EQ(writer.size(), 0u) << "after a failure nothing more is written";
  EXPECT_EQ(bytes[3], std::byte{0x5a});
}

TEST(ByteWriter, RefusesTextThatItsLengthFieldCannotHold) {
  std::vector<std::byte> bytes(70'000);
  ByteWriter fits(bytes);
  fits.put_text(std::string(65'535, 'x'));
  EXPECT_TRUE(fits.ok());
  ByteWriter too_long(bytes);
  too_long.put_text(std::string(65'536, 'x'));
  EXPECT_FALSE(too_long.ok());
  EXPECT_EQ(too_long.size(), 0u);
}

TEST(ByteWriter, TakesEmptyBytesAtTheVeryEnd) {
  std::array<std::byte, 1> bytes{};
  ByteWriter writer(bytes);
  writer.put<std::uint8_t>(7);
  writer.put_bytes({});
  writer.put_zeros(0);
  EXPECT_TRUE(writer.ok());
  EXPECT_EQ(writer.left(), 0u);
}

}  // namespace
}  // namespace rtpm
