#include "rtpm/base/utf8_path.hpp"

#include <gtest/gtest.h>

namespace rtpm {
namespace {

TEST(Utf8Path, ComesBackAsItWas) {
  for (const char* text : {"", "a/b", "Geräte im Haus/Ärm", "力覚"})
    EXPECT_EQ(utf8_of(path_of_utf8(text)), text);
}

}  // namespace
}  // namespace rtpm
