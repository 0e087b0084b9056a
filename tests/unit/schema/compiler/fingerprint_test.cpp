#include "rtpm/schema/fingerprint.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "scratch_folder.hpp"

namespace rtpm::schema {
namespace {

constexpr std::string_view kSchema = R"(include "rtpm.fbs";
namespace lab;
enum Mode : ubyte { Free = 0, Hold = 1 }
struct Force { x:double; y:double; }
table ForceMessage { value:Force (required); }
table Note { text:string; }
table Device { name:string; }
union Any { Note, Device }
table Inner { depth:int = 3; parent:Inner; }
table Request {
  mode:Mode = Hold;
  gain:float = 0.5;
  inner:Inner;
  any:Any;
  count:int = null;
  forces:[Force];
}
rpc_service Arm {
  set(ForceMessage):rtpm.Empty (rtpm_id: 1);
  ask(Request):ForceMessage (rtpm_id: 2);
}
)";

std::string with(const std::string& what, const std::string& instead) {
  return test::replaced(kSchema, what, instead);
}

Service service_of(std::string_view text) {
  Model model = test::model_of(text);
  return model.services.empty() ? Service{} : model.services.front();
}

/// A change of the schema's text.
struct Change {
  const char* what;
  const char* instead;
};

class Unimportant : public testing::TestWithParam<Change> {};

TEST_P(Unimportant, ChangeLeavesTheFingerprint) {
  const Service before = service_of(kSchema);
  const Service after = service_of(with(GetParam().what, GetParam().instead));
  EXPECT_EQ(before.fingerprint, after.fingerprint);
  ASSERT_EQ(before.methods.size(), after.methods.size());
}

INSTANTIATE_TEST_SUITE_P(
    Fingerprint, Unimportant,
    testing::Values(
        Change{"struct Force", "/// A force.\nstruct Force"},
        Change{"rpc_service Arm", "/// An arm.\nrpc_service Arm"},
        Change{"  gain:float", "  /// How strong.\n  gain:float"},
        Change{"  set(ForceMessage)", "  /// Sets it.\n  set(ForceMessage)"},
        Change{"namespace lab;", "namespace lab; // a comment"},
        Change{"table Note { text:string; }\ntable Device { name:string; }",
               "table Device { name:string; }\ntable Note { text:string; }"},
        Change{
            "set(ForceMessage):rtpm.Empty (rtpm_id: 1);\n  ask(Request):ForceMessage (rtpm_id: 2);",
            "ask(Request):ForceMessage (rtpm_id: 2);\n  set(ForceMessage):rtpm.Empty (rtpm_id: "
            "1);"},
        Change{"(rtpm_id: 1)", "(rtpm_id: 1, rtpm_deadline_us: 500)"},
        Change{"namespace lab;", "attribute \"tool\";\nnamespace lab;"},
        Change{"rpc_service Arm", "table Unused { x:int; }\nrpc_service Arm"}));

class Important : public testing::TestWithParam<Change> {};

TEST_P(Important, ChangeChangesTheFingerprint) {
  const Service before = service_of(kSchema);
  const Service after = service_of(with(GetParam().what, GetParam().instead));
  EXPECT_NE(before.fingerprint, after.fingerprint);
}

INSTANTIATE_TEST_SUITE_P(
    Fingerprint, Important,
    testing::Values(
        Change{"x:double; y:double;", "x:double; y:float;"},
        Change{"x:double; y:double;", "y:double; x:double;"},
        Change{"x:double; y:double;", "x:double; y:double; z:double;"},
        Change{"struct Force", "struct Force (force_align: 16)"},
        Change{"value:Force (required)", "value:Force"},
        Change{"value:Force (required)", "force:Force (required)"},
        Change{"value:Force (required);", "value:Force (required); more:int;"},
        Change{"gain:float = 0.5", "gain:float = 0.25"},
        Change{"gain:float = 0.5", "gain:double = 0.5"},
        Change{"gain:float = 0.5", "strength:float = 0.5"},
        Change{"gain:float = 0.5", "gain:float = 0.5 (deprecated)"},
        Change{"depth:int = 3", "depth:int = 4"}, Change{"depth:int = 3", "depth:int = 3 (key)"},
        Change{"mode:Mode = Hold;\n  gain:float = 0.5;", "gain:float = 0.5;\n  mode:Mode = Hold;"},
        Change{"Hold = 1", "Hold = 2"}, Change{"Hold = 1", "Hold = 1, Follow = 2"},
        Change{"mode:Mode = Hold", "mode:Mode = Free"}, Change{"Mode : ubyte", "Mode : short"},
        Change{"union Any { Note, Device }", "union Any { Device, Note }"},
        Change{"text:string", "text:string (required)"}, Change{"text:string", "text:[string]"},
        Change{"count:int = null", "count:int"},
        Change{"forces:[Force];", "forces:[Force]; more:[ubyte];"},
        Change{"rtpm_id: 1", "rtpm_id: 3"}, Change{"rtpm_id: 1", "rtpm_id: 1, rtpm_idempotent"},
        Change{"  set(", "  put("}, Change{"rpc_service Arm", "rpc_service Leg"},
        Change{"namespace lab;", "namespace labs;"},
        Change{"set(ForceMessage):rtpm.Empty", "set(rtpm.Empty):ForceMessage"},
        Change{"  ask(Request)", "  more(rtpm.Empty):rtpm.Empty (rtpm_id: 9);\n  ask(Request)"}));

TEST(Fingerprint, OfAMethodDoesNotDependOnOtherMethods) {
  const Service before = service_of(kSchema);
  const Service after = service_of(with("gain:float = 0.5", "gain:float = 0.25"));
  EXPECT_EQ(before.methods[0].fingerprint, after.methods[0].fingerprint);
  EXPECT_NE(before.methods[1].fingerprint, after.methods[1].fingerprint);
}

TEST(Fingerprint, DependsNeitherOnTheFilesNameNorOnItsFolder) {
  const test::ScratchFolder folder;
  const auto one =
      compile({.file = folder.write("arm.fbs", kSchema), .include_paths = {RTPM_IDL_FOLDER}});
  const auto two = compile(
      {.file = folder.write("deep/er/leg.fbs", kSchema), .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(one.model && two.model);
  EXPECT_EQ(one.model->services[0].fingerprint, two.model->services[0].fingerprint);
}

TEST(Fingerprint, DoesNotDependOnWhichFileDeclaresAType) {
  const test::ScratchFolder folder;
  const std::size_t service = kSchema.find("rpc_service");
  folder.write("types.fbs", kSchema.substr(0, service));
  const std::string split = "include \"rtpm.fbs\";\ninclude \"types.fbs\";\nnamespace lab;\n" +
                            std::string(kSchema.substr(service));
  const auto result =
      compile({.file = folder.write("arm.fbs", split), .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  EXPECT_EQ(result.model->services[0].fingerprint, service_of(kSchema).fingerprint);
}

TEST(Fingerprint, IsTheSameOnEveryMachine) {
  // Old and new programs cannot bind to each other if these numbers change.
  const Service service = service_of(kSchema);
  EXPECT_EQ(service.fingerprint, 4551446719405322146u);
  EXPECT_EQ(service.methods[0].fingerprint, 2138556786u);
}

TEST(Fingerprint, TextNamesEachReachedTypeOnce) {
  const Model model = test::model_of(kSchema);
  const std::string text = canonical_text(model, model.services[0].methods[1]);
  EXPECT_EQ(text.find("table lab.Inner {"), text.rfind("table lab.Inner {"));
  for (const char* name : {"table lab.Request {", "struct lab.Force size 16 align 8 {",
                           "enum lab.Mode uint8 {", "union lab.Any", "table lab.Note {"}) {
    EXPECT_NE(text.find(name), std::string::npos) << name << " is not in\n" << text;
  }
}

}  // namespace
}  // namespace rtpm::schema
