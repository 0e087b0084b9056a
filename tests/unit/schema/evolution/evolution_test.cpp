#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "evolution_exchange.hpp"
#include "evolution_schema.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "rtpm/wire/interface_text.hpp"
#include "scratch_folder.hpp"

// Tests `rtpmc check --conform`: edits random schemas, lets old and new sides exchange messages,
// and compares what they understand with the verdict on the edit.
namespace rtpm::schema {
namespace {

using test::Random;
using test::Side;

struct Prediction {
  bool breaks_old_clients = false;
  bool breaks_new_clients = false;
  bool is_by_meaning = false;  ///< The change need not show in bytes.
};

/// Changes that an exchange of bytes cannot show: promises, and the meaning of numbers.
bool is_promise(const Change& change) {
  switch (change.kind) {
    case ChangeKind::kIdempotentAdded:
    case ChangeKind::kIdempotentRemoved:
    case ChangeKind::kMaxSizeRaised:
    case ChangeKind::kMaxSizeLowered:
      return true;
    default:
      return change.reading.is_by_meaning;
  }
}

Prediction predict(const std::vector<Change>& changes) {
  Prediction prediction;
  for (const Change& change : changes) {
    prediction.breaks_old_clients |= change.breaks_old_clients;
    prediction.breaks_new_clients |= change.breaks_new_clients;
    prediction.is_by_meaning |= is_promise(change);
  }
  return prediction;
}

/// Changes that a bind cannot detect: a removed declaration looks as if the other side were older,
/// and limits are not compared.
bool is_undetected_at_bind(const Change& change) {
  switch (change.kind) {
    case ChangeKind::kFieldRemoved:
      return change.reading.is_by_meaning;
    case ChangeKind::kEnumValueRemoved:
    case ChangeKind::kFieldRangeNarrowed:
    case ChangeKind::kFieldRangeWidened:
    case ChangeKind::kMaxSizeRaised:
    case ChangeKind::kMaxSizeLowered:
      return true;
    default:
      return false;
  }
}

/// Whether a client binds to a server of the other version.
bool can_bind(const Side& client, const Side& server) {
  const auto text = [](const Side& side) {
    return interface_text(side.model(), side.model().services.front());
  };
  return !wire::find_obstacle(text(client), text(server));
}

/// Expects that exactly compatible versions bind, and nothing is misread.
void expect_bind(const char* clients, bool binds, bool is_reported_to_break, bool is_undetected,
                 bool is_understood) {
  if (is_reported_to_break && !is_undetected) {
    EXPECT_FALSE(binds) << clients << " bind";
  }
  if (!is_reported_to_break) {
    EXPECT_TRUE(binds) << clients << " do not bind";
  }
  if (!is_understood) {
    EXPECT_FALSE(binds) << clients << " bind, and do not understand";
  }
}

std::string describe(const Side& before, const Side& after, const std::vector<Change>& changes) {
  return "verdict:\n" + render(changes) + "before:\n" + before.schema().text() + "after:\n" +
         after.schema().text();
}

bool has_kind(const std::vector<Change>& changes, ChangeKind kind) {
  return std::any_of(changes.begin(), changes.end(),
                     [kind](const Change& change) { return change.kind == kind; });
}

// Each seed is a schema and one edit of it.
constexpr unsigned kEditCount = 400;

TEST(Evolution, VerdictsMatchTheExchangesOfOldAndNewPrograms) {
  std::map<ChangeKind, int> edits;
  std::map<ChangeKind, int> shown;
  unsigned count = 0;
  for (unsigned seed = 0; count < kEditCount; ++seed) {
    ASSERT_LT(seed, 10 * kEditCount) << "hardly any edit fits";
    Random random(seed);
    const test::SchemaText old_schema = test::random_schema(random);
    test::SchemaText new_schema = old_schema;
    const auto kind = test::edit(new_schema, random);
    if (!kind || new_schema.text() == old_schema.text()) continue;
    ++count;
    Side before(old_schema);
    Side after(new_schema);
    const std::vector<Change> changes = compare(before.model(), after.model());
    const Prediction predicted = predict(changes);
    const std::string what = "seed " + std::to_string(seed) + ", ";
    ASSERT_TRUE(has_kind(changes, *kind)) << what << name_of(*kind) << " is not reported\n"
                                          << describe(before, after, changes);

    const bool old_clients_work = can_call(before, after, random);
    const bool new_clients_work = can_call(after, before, random);
    // A compatible edit is understood.
    ASSERT_TRUE(predicted.breaks_old_clients || old_clients_work)
        << what << "old clients do not understand new servers\n"
        << describe(before, after, changes);
    ASSERT_TRUE(predicted.breaks_new_clients || new_clients_work)
        << what << "new clients do not understand old servers\n"
        << describe(before, after, changes);
    // An edit that is incompatible by its bytes shows in bytes.
    if (!predicted.is_by_meaning) {
      ASSERT_EQ(predicted.breaks_old_clients || predicted.breaks_new_clients,
                !old_clients_work || !new_clients_work)
          << what << "nothing shows the break\n"
          << describe(before, after, changes);
    }
    const bool is_undetected = std::any_of(changes.begin(), changes.end(), is_undetected_at_bind);
    expect_bind("old clients", can_bind(before, after), predicted.breaks_old_clients, is_undetected,
                old_clients_work);
    expect_bind("new clients", can_bind(after, before), predicted.breaks_new_clients, is_undetected,
                new_clients_work);
    ASSERT_FALSE(HasFailure()) << what << describe(before, after, changes);
    ++edits[*kind];
    shown[*kind] += !old_clients_work || !new_clients_work ? 1 : 0;
  }
  // The edits include most kinds of change.
  EXPECT_GE(edits.size(), 28u);
  for (const auto& [kind, number] : edits) {
    RecordProperty(std::string(name_of(kind)),
                   std::to_string(number) + ", broken " + std::to_string(shown[kind]));
  }
}

// Edits do not hide each other: if none is reported to break, nothing breaks.
TEST(Evolution, SeveralEditsAreAsCompatibleAsTheWorst) {
  unsigned compatible = 0;
  for (unsigned seed = 10'000; seed < 10'150; ++seed) {
    Random random(seed);
    const test::SchemaText old_schema = test::random_schema(random);
    test::SchemaText new_schema = old_schema;
    for (int i = 0; i < 3; ++i)
      (void)test::edit(new_schema, random);
    // Two edits of one declaration may not give a valid schema.
    if (!test::compile_text(new_schema.text()).model) continue;
    Side before(old_schema);
    Side after(new_schema);
    const std::vector<Change> changes = compare(before.model(), after.model());
    const Prediction predicted = predict(changes);
    compatible += !predicted.breaks_old_clients || !predicted.breaks_new_clients ? 1U : 0U;
    const auto expect_understanding = [&](Side& client, Side& server, bool is_reported_to_break) {
      const bool is_understood = can_call(client, server, random);
      const bool binds = can_bind(client, server);
      // Versions that bind despite the verdict understand each other as far as bytes show.
      EXPECT_TRUE(is_understood || (is_reported_to_break && !binds));
      EXPECT_TRUE(is_reported_to_break || binds);
    };
    expect_understanding(before, after, predicted.breaks_old_clients);
    expect_understanding(after, before, predicted.breaks_new_clients);
    ASSERT_FALSE(HasFailure()) << "seed " << seed << '\n' << describe(before, after, changes);
  }
  EXPECT_GT(compatible, 5u);
}

}  // namespace
}  // namespace rtpm::schema
