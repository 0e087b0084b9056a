#pragma once

#include <gtest/gtest.h>

#include <utility>

#include "rtpm/base/expected.hpp"

namespace rtpm::test {

/// The object in `result`; fails the test with the error's text, and is null, if there is none.
template <class Pointer, class Error>
[[nodiscard]] Pointer made(expected<Pointer, Error> result) {
  EXPECT_TRUE(result) << result.error().text();
  return result ? std::move(*result) : Pointer{};
}

}  // namespace rtpm::test
