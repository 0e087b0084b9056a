#include "rtpm/wire/control.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "frames.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {
namespace {

using namespace test;

Bytes encoded(const BindRequest& request) {
  Bytes bytes(1024);
  bytes.resize(encode(request, bytes));
  bytes.shrink_to_fit();
  return bytes;
}

Bytes encoded(const BindReply& reply, const std::vector<MethodEntry>& methods) {
  Bytes bytes(BindReply::kSize + methods.size() * MethodEntry::kSize, std::byte{0xee});
  encode(reply, bytes);
  for (std::size_t i = 0; i < methods.size(); ++i) {
    encode(methods[i], MutableBytes(bytes).subspan(BindReply::kSize + i * MethodEntry::kSize));
  }
  return bytes;
}

TEST(BindRequest, ComesBackAsItWasWritten) {
  const std::string longest(kPathSizeMax, 'p');
  for (const std::string& path : {std::string("lab/arm0"), std::string(), longest}) {
    for (const std::string& interface : {std::string("lab.Arm"), std::string()}) {
      const Bytes bytes = encoded({path, interface, 0x0123456789abcdef});
      ASSERT_FALSE(bytes.empty());
      const auto read = decode_bind_request(bytes);
      ASSERT_TRUE(read);
      EXPECT_EQ(read->path, path);
      EXPECT_EQ(read->interface, interface);
      EXPECT_EQ(read->fingerprint, 0x0123456789abcdef);
    }
  }
}

TEST(BindRequest, IsNotEncodedWhereItDoesNotFit) {
  const BindRequest request{"lab/arm0", "lab.Arm", 1};
  const std::size_t size = encoded(request).size();
  for (std::size_t buffer = 0; buffer < size; ++buffer) {
    Bytes bytes(buffer);
    EXPECT_EQ(encode(request, bytes), 0u) << buffer;
  }
  const std::string too_long(kPathSizeMax + 1, 'p');
  Bytes bytes(1024);
  EXPECT_EQ(encode(BindRequest{too_long, "lab.Arm", 1}, bytes), 0u);
}

TEST(BindRequest, IsNotReadWhenCutOrExtended) {
  const Bytes good = encoded({"lab/arm0", "lab.Arm", 1});
  for (std::size_t size = 0; size < good.size(); ++size) {
    Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    cut.shrink_to_fit();
    EXPECT_FALSE(decode_bind_request(cut)) << size;
  }
  Bytes longer = good;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(decode_bind_request(longer));
}

TEST(BindRequest, WithTooLongAPathIsNotRead) {
  Bytes bytes(1024);
  ByteWriter writer(bytes);
  writer.put(std::uint64_t{1});
  writer.put_text(std::string(kPathSizeMax + 1, 'p'));
  writer.put_text("lab.Arm");
  bytes.resize(writer.size());
  EXPECT_FALSE(decode_bind_request(bytes));
}

TEST(BindReply, ComesBackAsItWasWritten) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    std::vector<MethodEntry> methods(random() % 20);
    for (MethodEntry& method : methods) {
      method = {static_cast<std::uint16_t>(random()), static_cast<std::uint32_t>(random())};
    }
    BindReply reply;
    reply.service = static_cast<std::uint32_t>(random()) | 1;
    reply.is_server_declared = random() % 2 == 0;
    reply.priority = static_cast<int>(random() % (Priority::kHighest + 1));
    reply.fingerprint = random();
    reply.method_count = static_cast<std::uint16_t>(methods.size());
    reply.is_method_list_complete = random() % 2 == 0;
    const Bytes bytes = encoded(reply, methods);
    const auto read = decode_bind_reply(bytes);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->service, reply.service);
    EXPECT_EQ(read->is_server_declared, reply.is_server_declared);
    EXPECT_EQ(read->priority, reply.priority);
    EXPECT_EQ(read->fingerprint, reply.fingerprint);
    EXPECT_EQ(read->method_count, reply.method_count);
    EXPECT_EQ(read->is_method_list_complete, reply.is_method_list_complete);
    for (std::uint16_t i = 0; i < reply.method_count; ++i) {
      EXPECT_EQ(method_entry(bytes, i).id, methods[i].id);
      EXPECT_EQ(method_entry(bytes, i).fingerprint, methods[i].fingerprint);
    }
  }
}

TEST(BindReply, ThatCanNotBeMeantIsNotRead) {
  BindReply reply;
  reply.service = 1;
  reply.method_count = 2;
  const Bytes good = encoded(reply, {{1, 11}, {2, 22}});
  ASSERT_TRUE(decode_bind_reply(good));
  for (std::size_t size = 0; size < good.size(); ++size) {
    Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    cut.shrink_to_fit();
    EXPECT_FALSE(decode_bind_reply(cut)) << size;
  }
  Bytes bytes = good;
  bytes.push_back(std::byte{0});
  EXPECT_FALSE(decode_bind_reply(bytes)) << "a byte behind the list";
  bytes = good;
  bytes[16] = std::byte{3};
  EXPECT_FALSE(decode_bind_reply(bytes)) << "more methods than there are bytes for";
  bytes = good;
  store_le(bytes.data(), std::uint32_t{0});
  EXPECT_FALSE(decode_bind_reply(bytes)) << "the session's own number";
  bytes = good;
  store_le(bytes.data() + 4, std::uint16_t{32768});
  EXPECT_FALSE(decode_bind_reply(bytes)) << "a priority above 32767";
  bytes = good;
  bytes[6] |= std::byte{4};
  EXPECT_FALSE(decode_bind_reply(bytes)) << "a flag that nobody knows";
}

// The reserved bytes of a bind's reply must be zero, like all reserved bytes (hp-6.1-5).
TEST(BindReply, WithAReservedByteSetIsNotRead) {
  BindReply reply;
  reply.service = 1;
  reply.method_count = 1;
  const Bytes good = encoded(reply, {{1, 11}});
  for (const std::size_t offset : {7u, 18u, 19u, 20u, 21u, 22u, 23u, 26u, 27u}) {
    Bytes bytes = good;
    ASSERT_EQ(bytes[offset], std::byte{0}) << offset;
    bytes[offset] = std::byte{1};
    EXPECT_FALSE(decode_bind_reply(bytes)) << offset;
  }
}

TEST(Bind, RandomPayloadsAreNeverReadPastTheirEnd) {
  Random random(2);
  for (int round = 0; round < 5000; ++round) {
    const Bytes bytes = random_bytes(random, random() % 64);
    if (const auto request = decode_bind_request(bytes)) {
      EXPECT_EQ(12 + request->path.size() + request->interface.size(), bytes.size());
    }
    if (const auto reply = decode_bind_reply(bytes)) {
      EXPECT_EQ(BindReply::kSize + reply->method_count * MethodEntry::kSize, bytes.size());
    }
  }
}

}  // namespace
}  // namespace rtpm::wire
