#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "store/store.hpp"

// The errors of the CosNaming service, mapped to names. Longer names imply contexts.
namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kOwner{.id = 1, .epoch = 1};
constexpr Owner kOther{.id = 2, .epoch = 1};
constexpr MonotonicTime kNow{1s};

enum class Operation { kBind, kRebind, kResolve, kUnbind };

struct Row {
  const char* exception;  ///< The name in CosNaming.
  Operation operation;
  const char* name;
  Outcome outcome;
  int component;
};

class CosNaming : public testing::TestWithParam<Row> {};

TEST_P(CosNaming, ReportsItsErrorAtTheComponent) {
  Store store;
  const auto claim = [](std::string_view name, Owner owner) {
    return Claim{name, "rtpm://h:1/p", "lab.Arm", owner, 2s};
  };
  ASSERT_TRUE(store.bind(claim("lab/arm0", kOther), kNow));
  ASSERT_TRUE(store.bind(claim("lab/left/arm1", kOther), kNow));
  const Row& row = GetParam();
  Refusal refusal;
  const auto note = [&](const auto& result) {
    if (!result) refusal = result.error();
  };
  switch (row.operation) {
    case Operation::kBind:
      note(store.bind(claim(row.name, kOwner), kNow));
      break;
    case Operation::kRebind: {
      Claim taking = claim(row.name, kOwner);
      taking.allows_takeover = true;
      note(store.rebind(taking, kNow));
      break;
    }
    case Operation::kResolve:
      note(store.resolve(row.name, kNow));
      break;
    case Operation::kUnbind:
      note(store.unbind(row.name, kOwner, kNow));
      break;
  }
  EXPECT_EQ(refusal.outcome, row.outcome) << row.exception << ": " << row.name;
  EXPECT_EQ(refusal.component, row.component) << row.exception << ": " << row.name;
}

INSTANTIATE_TEST_SUITE_P(
    Errors, CosNaming,
    testing::Values(
        Row{"NotFound missing_node", Operation::kResolve, "hall/arm0", Outcome::kNotFound, 0},
        Row{"NotFound missing_node", Operation::kResolve, "lab/arm9", Outcome::kNotFound, 1},
        Row{"NotFound missing_node", Operation::kUnbind, "lab/left/arm9", Outcome::kNotFound, 2},
        Row{"NotFound not_context", Operation::kResolve, "lab/arm0/x", Outcome::kNotADirectory, 1},
        Row{"NotFound not_context", Operation::kBind, "lab/arm0/x", Outcome::kNotADirectory, 1},
        Row{"NotFound not_object", Operation::kResolve, "lab/left", Outcome::kIsADirectory, 1},
        Row{"NotFound not_object", Operation::kUnbind, "lab", Outcome::kIsADirectory, 0},
        Row{"NotFound not_object", Operation::kRebind, "lab/left", Outcome::kIsADirectory, 1},
        Row{"AlreadyBound", Operation::kBind, "lab/arm0", Outcome::kAlreadyBound, 1},
        Row{"AlreadyBound, a context", Operation::kBind, "lab", Outcome::kIsADirectory, 0},
        Row{"rebind replaces", Operation::kRebind, "lab/arm0", Outcome::kDone, 0},
        Row{"bind makes contexts", Operation::kBind, "hall/far/arm0", Outcome::kDone, 0},
        Row{"InvalidName, no component", Operation::kBind, "", Outcome::kBadName, 0},
        Row{"InvalidName, an empty one", Operation::kResolve, "lab//arm0", Outcome::kBadName, 1},
        Row{"InvalidName", Operation::kUnbind, "lab/arm 0", Outcome::kBadName, 1},
        Row{"CannotProceed, not permitted", Operation::kUnbind, "lab/arm0", Outcome::kNotOwner,
            1}));

}  // namespace
}  // namespace rtpm::names
