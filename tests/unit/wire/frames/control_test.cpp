#include "rtpm/wire/control.hpp"

#include <gtest/gtest.h>

#include <string>

#include "frames.hpp"
#include "rtpm/wire/limits.hpp"

// Payloads of binds that do not fit or are cut; spec/vectors has the cases of each field.
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

TEST(Bind, IsNotReadWhenCut) {
  const Bytes request = encoded({"lab/arm0", "lab.Arm", 1});
  BindReply two_methods;
  two_methods.service = 1;
  two_methods.method_count = 2;
  const Bytes reply = encoded(two_methods, {{1, 11}, {2, 22}});
  ASSERT_TRUE(decode_bind_request(request) && decode_bind_reply(reply));
  for (std::size_t size = 0; size < request.size(); ++size) {
    EXPECT_FALSE(decode_bind_request(copy_of(ConstBytes(request).first(size)))) << size;
  }
  for (std::size_t size = 0; size < reply.size(); ++size) {
    EXPECT_FALSE(decode_bind_reply(copy_of(ConstBytes(reply).first(size)))) << size;
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
