#include "rtpm/schema/conform.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "scratch_folder.hpp"

// Every kind of change: its name, what it breaks, and its message.
namespace rtpm::schema {
namespace {

constexpr std::string_view kSchema = R"(include "rtpm.fbs";
namespace lab;
enum Mode : ubyte { Free, Hold, Follow }
struct Force { x:double; y:double; }
struct Pair { a:int; b:int; c:short; }
table ForceMessage { value:Force (required); }
table Leaf { label:string; }
table Twig { size:int; }
union Part { Leaf, Twig }
table Request {
  count:int = 5;
  gain:float (rtpm_unit: "newton", rtpm_range: "-10..10", rtpm_frame: "base");
  name:string (required);
  bytes:[ubyte];
  mode:Mode = Hold;
  part:Part;
  pair:Pair;
  gone:int (deprecated);
  last:int;
}
table Reply { value:int; text:string (required); optional:string; }
table Pressed (rtpm_event: 7) { button:int; }
table Alone { x:int; }
table Keyed { key:int (key); text:string; }
rpc_service Arm (rtpm_priority: 100) {
  set(ForceMessage):rtpm.Empty (rtpm_id: 1);
  ask(Request):Reply (rtpm_id: 2, rtpm_max_size: 1000);
  look(rtpm.Empty):Reply (rtpm_id: 3, rtpm_idempotent);
  find(Keyed):Reply (rtpm_id: 4);
}
rpc_service Leg { step(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }
)";

using Kind = ChangeKind;

struct Case {
  const char* what;
  const char* instead;
  ChangeKind kind;
  Verdict verdict;
};

constexpr Verdict kOk = Verdict::kCompatible;
constexpr Verdict kFirst = Verdict::kServersFirst;
constexpr Verdict kBad = Verdict::kIncompatible;

// In the order of ChangeKind.
constexpr Case kCases[] = {
    {"rpc_service Leg", "rpc_service Foot { x(Alone):Alone (rtpm_id: 1); } rpc_service Leg",
     Kind::kServiceAdded, kOk},
    {"rpc_service Leg { step(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }", "", Kind::kServiceRemoved,
     kBad},
    {"rtpm_priority: 100", "rtpm_priority: 200", Kind::kPriorityChanged, kOk},
    {"  look(", "  add(Keyed):Keyed (rtpm_id: 9);\n  look(", Kind::kMethodAdded, kFirst},
    {"  find(Keyed):Reply (rtpm_id: 4);\n", "", Kind::kMethodRemoved, kBad},
    {"find(", "search(", Kind::kMethodRenamed, kBad},
    {"rtpm_id: 4", "rtpm_id: 5", Kind::kMethodRenumbered, kBad},
    {"find(Keyed)", "find(Request)", Kind::kPayloadReplaced, kBad},
    {"value:Force (required); }", "value:Force (required); more:int; }", Kind::kPayloadKind, kBad},
    {"rtpm_id: 4", "rtpm_id: 4, rtpm_idempotent", Kind::kIdempotentAdded, kFirst},
    {"rtpm_id: 3, rtpm_idempotent", "rtpm_id: 3", Kind::kIdempotentRemoved, kBad},
    {"rtpm_id: 1);\n  ask", "rtpm_id: 1, rtpm_oneway: \"sent\");\n  ask", Kind::kMannerChanged,
     kBad},
    {"rtpm_id: 4", "rtpm_id: 4, rtpm_deferred", Kind::kDeferredChanged, kOk},
    {"rtpm_id: 4", "rtpm_id: 4, rtpm_deadline_us: 5", Kind::kDeadlineChanged, kOk},
    {"rtpm_max_size: 1000", "rtpm_max_size: 2000", Kind::kMaxSizeRaised, kFirst},
    {"rtpm_max_size: 1000", "rtpm_max_size: 500", Kind::kMaxSizeLowered, kBad},
    {"table Alone", "table Newcomer { x:int; }\ntable Alone", Kind::kTypeAdded, kOk},
    {"table Alone { x:int; }", "", Kind::kTypeRemoved, kBad},
    {"table Alone", "struct Alone", Kind::kTypeKind, kBad},
    {"struct Force { x:double; y:double; }", "struct Force { x:double; y:double; z:double; }",
     Kind::kStructLayout, kBad},
    {"table Alone {", "table Alone (rtpm_event: 8) {", Kind::kEventAdded, kOk},
    {"rtpm_event: 7", "rtpm_event: 9", Kind::kEventChanged, kBad},
    {"  last:int;", "  last:int;\n  more:int;", Kind::kFieldAdded, kOk},
    {"  last:int;", "  last:int;\n  more:string (required);", Kind::kFieldAddedRequired, kBad},
    {"  last:int;", "", Kind::kFieldRemoved, kBad},
    {"  count:int = 5;", "  front:int;\n  count:int = 5;", Kind::kFieldMoved, kBad},
    {"bytes:[ubyte]", "octets:[ubyte]", Kind::kFieldRenamed, kBad},
    {"last:int", "last:long", Kind::kFieldRetyped, kBad},
    {"count:int = 5", "count:int = 6", Kind::kFieldDefault, kBad},
    {"bytes:[ubyte]", "bytes:[ubyte] (required)", Kind::kFieldRequired, kBad},
    {"name:string (required)", "name:string", Kind::kFieldNotRequired, kFirst},
    {"last:int", "last:int (deprecated)", Kind::kFieldDeprecated, kOk},
    {"gone:int (deprecated)", "gone:int", Kind::kFieldUndeprecated, kOk},
    {"key:int (key)", "key:int", Kind::kFieldKey, kBad},
    {"bytes:[ubyte]", "bytes:[ubyte] (nested_flatbuffer: \"Leaf\")", Kind::kFieldEncoding, kBad},
    {"\"newton\"", "\"ounce\"", Kind::kFieldUnit, kBad},
    {"\"base\"", "\"world\"", Kind::kFieldFrame, kBad},
    {"-10..10", "-10..5", Kind::kFieldRangeNarrowed, kBad},
    {"-10..10", "-20..10", Kind::kFieldRangeWidened, kFirst},
    {"enum Mode : ubyte", "enum Mode : ushort", Kind::kEnumUnderlying, kBad},
    {"Follow }", "Follow, Rest }", Kind::kEnumValueAdded, kOk},
    {", Follow }", " }", Kind::kEnumValueRemoved, kBad},
    {"Follow }", "Guide }", Kind::kEnumValueRenamed, kBad},
    {"Free, Hold", "Hold, Free", Kind::kEnumValueRenumbered, kBad},
    {"union Part { Leaf, Twig }", "union Part { Leaf, Twig:Keyed }", Kind::kUnionMemberRetyped,
     kBad},
};

std::string with(const Case& c) {
  return test::replaced(kSchema, c.what, c.instead);
}

/// Compares two texts as the files old.fbs and new.fbs.
std::vector<Change> changes_between(const std::string& before, const std::string& after) {
  const test::ScratchFolder folder;
  const auto compile_as = [&](const char* name, const std::string& text) {
    folder.write(name, text);
    const std::filesystem::path here = std::filesystem::current_path();
    std::filesystem::current_path(folder.path());
    CompileResult result = compile({.file = name, .include_paths = {RTPM_IDL_FOLDER}});
    std::filesystem::current_path(here);
    EXPECT_TRUE(result.model) << render(result.errors);
    return result.model ? *result.model : Model{};
  };
  return compare(compile_as("old.fbs", before), compile_as("new.fbs", after));
}

TEST(Conform, EveryKindOfChangeHasItsVerdict) {
  std::set<ChangeKind> seen;
  for (const Case& c : kCases) {
    const std::vector<Change> changes = changes_between(std::string(kSchema), with(c));
    bool is_found = false;
    for (const Change& change : changes) {
      if (change.kind != c.kind) continue;
      is_found = true;
      EXPECT_EQ(change.verdict, c.verdict) << c.instead << '\n' << render(changes);
    }
    EXPECT_TRUE(is_found) << name_of(c.kind) << '\n' << render(changes);
    seen.insert(c.kind);
  }
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(ChangeKind::kUnionMemberRetyped) + 1);
}

TEST(Conform, IgnoresCommentsAndOrder) {
  EXPECT_EQ(render(changes_between(std::string(kSchema), std::string(kSchema))), "");
  // Comments, the order of declarations and other tools' attributes do not matter.
  std::string text = "/* A comment. */ " + std::string(kSchema);
  const std::string alone = "table Alone { x:int; }\n";
  text.erase(text.find(alone), alone.size());
  text.insert(text.find("table Leaf"), "/// Documented.\n" + alone);
  EXPECT_EQ(render(changes_between(std::string(kSchema), text)), "");
}

// One cause is reported once, however many fields and methods it affects.
TEST(Conform, ReportsOneCauseOnce) {
  for (const Case& c : kCases) {
    if (c.kind == Kind::kServiceAdded || c.kind == Kind::kPayloadKind ||
        c.kind == Kind::kTypeRemoved) {
      continue;  // A new service has a new method, a table of another kind a new field.
    }
    EXPECT_EQ(changes_between(std::string(kSchema), with(c)).size(), 1u)
        << name_of(c.kind) << '\n'
        << render(changes_between(std::string(kSchema), with(c)));
  }
}

// Clients write requests and read replies.
TEST(Conform, DirectionDependsOnTheRole) {
  const auto verdict = [](const char* what, const char* instead) {
    const auto changes = changes_between(std::string(kSchema), with({what, instead, {}, {}}));
    return changes.empty() ? kOk : changes.front().verdict;
  };
  EXPECT_EQ(verdict("name:string (required)", "name:string"), kFirst);
  EXPECT_EQ(verdict("text:string (required)", "text:string"), kBad);
  EXPECT_EQ(verdict("bytes:[ubyte]", "bytes:[ubyte] (required)"), kBad);
  EXPECT_EQ(verdict("optional:string", "optional:string (required)"), kFirst);
}

TEST(Conform, EveryTextIsAsReviewed) {
  std::string all;
  for (const Case& c : kCases) {
    all += "# " + std::string(name_of(c.kind)) + '\n' +
           render(changes_between(std::string(kSchema), with(c))) + '\n';
  }
  test::expect_golden(std::filesystem::path(RTPM_GOLDEN_FOLDER) / "conform" / "changes.golden",
                      all);
}

}  // namespace
}  // namespace rtpm::schema
