#include "rtpm/wire/control.hpp"

#include <gtest/gtest.h>

#include <string>

#include "frames.hpp"
#include "rtpm/wire/limits.hpp"

// Requests that do not fit; spec/vectors has the cases of each field.
namespace rtpm::wire {
namespace {

using namespace test;

Bytes encoded(const BindRequest& request) {
  Bytes bytes(1024);
  bytes.resize(encode(request, bytes));
  bytes.shrink_to_fit();
  return bytes;
}

TEST(BindRequest, IsNotEncodedIfItDoesNotFit) {
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

}  // namespace
}  // namespace rtpm::wire
