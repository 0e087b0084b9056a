#include "rtpm/base/setup_error.hpp"

#include <gtest/gtest.h>

#include <cerrno>

namespace rtpm {
namespace {

SetupError error_of(const unexpected<SetupError>& failure) {
  return failure.error;
}

TEST(SetupError, StatesFailureCauseAndRemedy) {
  EXPECT_EQ(error_of(setup_error("the lane is not made")).text(), "the lane is not made.");
  EXPECT_EQ(error_of(setup_error("the lane is not made.", "", "wait.")).text(),
            "the lane is not made. Remedy: wait.");
  EXPECT_EQ(error_of(setup_error("port 1", system_error(EACCES), "take another")).text(),
            "port 1: Permission denied. Remedy: take another.");
}

TEST(SetupError, KeepsTheRemedyAndCauseOfAnInnerError) {
  const SetupError inner = error_of(setup_error("port 1", system_error(EACCES), "take another"));
  const SetupError outer = error_of(setup_error("server 'arm'", inner));
  EXPECT_EQ(outer.text(), "server 'arm': port 1: Permission denied. Remedy: take another.");
  EXPECT_EQ(outer.cause, std::errc::permission_denied);
}

TEST(SetupError, EscapesForeignText) {
  EXPECT_EQ(error_of(setup_error("name 'a\x1b[2J\n'")).text(), "name 'a\\x1b[2J\\n'.");
}

}  // namespace
}  // namespace rtpm
