#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rtpm::test {

/// Fails the test for each of `parts` that `text` does not contain.
inline void expect_text(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) {
    EXPECT_NE(text.find(part), text.npos) << "'" << part << "' is not in: " << text;
  }
}

}  // namespace rtpm::test
