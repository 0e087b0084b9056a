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

constexpr Change kUnimportant[] = {
    {"struct Force", "/// A force.\nstruct Force"},
    {"rpc_service Arm", "/// An arm.\nrpc_service Arm"},
    {"  gain:float", "  /// How strong.\n  gain:float"},
    {"  set(ForceMessage)", "  /// Sets it.\n  set(ForceMessage)"},
    {"namespace lab;", "namespace lab; // a comment"},
    {"table Note { text:string; }\ntable Device { name:string; }",
     "table Device { name:string; }\ntable Note { text:string; }"},
    {"set(ForceMessage):rtpm.Empty (rtpm_id: 1);\n  ask(Request):ForceMessage (rtpm_id: 2);",
     "ask(Request):ForceMessage (rtpm_id: 2);\n  set(ForceMessage):rtpm.Empty (rtpm_id: "
     "1);"},
    {"(rtpm_id: 1)", "(rtpm_id: 1, rtpm_deadline_us: 500)"},
    {"namespace lab;", "attribute \"tool\";\nnamespace lab;"},
    {"rpc_service Arm", "table Unused { x:int; }\nrpc_service Arm"}};

constexpr Change kImportant[] = {
    {"x:double; y:double;", "x:double; y:float;"},
    {"x:double; y:double;", "y:double; x:double;"},
    {"x:double; y:double;", "x:double; y:double; z:double;"},
    {"struct Force", "struct Force (force_align: 16)"},
    {"value:Force (required)", "value:Force"},
    {"value:Force (required)", "force:Force (required)"},
    {"value:Force (required);", "value:Force (required); more:int;"},
    {"gain:float = 0.5", "gain:float = 0.25"},
    {"gain:float = 0.5", "gain:double = 0.5"},
    {"gain:float = 0.5", "strength:float = 0.5"},
    {"gain:float = 0.5", "gain:float = 0.5 (deprecated)"},
    {"depth:int = 3", "depth:int = 4"},
    {"depth:int = 3", "depth:int = 3 (key)"},
    {"mode:Mode = Hold;\n  gain:float = 0.5;", "gain:float = 0.5;\n  mode:Mode = Hold;"},
    {"Hold = 1", "Hold = 2"},
    {"Hold = 1", "Hold = 1, Follow = 2"},
    {"mode:Mode = Hold", "mode:Mode = Free"},
    {"Mode : ubyte", "Mode : short"},
    {"union Any { Note, Device }", "union Any { Device, Note }"},
    {"text:string", "text:string (required)"},
    {"text:string", "text:[string]"},
    {"count:int = null", "count:int"},
    {"forces:[Force];", "forces:[Force]; more:[ubyte];"},
    {"rtpm_id: 1", "rtpm_id: 3"},
    {"rtpm_id: 1", "rtpm_id: 1, rtpm_idempotent"},
    {"  set(", "  put("},
    {"rpc_service Arm", "rpc_service Leg"},
    {"namespace lab;", "namespace labs;"},
    {"set(ForceMessage):rtpm.Empty", "set(rtpm.Empty):ForceMessage"},
    {"  ask(Request)", "  more(rtpm.Empty):rtpm.Empty (rtpm_id: 9);\n  ask(Request)"}};

TEST(Fingerprint, ChangesOnlyWithWhatBothSidesMustAgreeOn) {
  const std::uint64_t before = service_of(kSchema).fingerprint;
  for (const Change& change : kUnimportant) {
    EXPECT_EQ(service_of(with(change.what, change.instead)).fingerprint, before) << change.instead;
  }
  for (const Change& change : kImportant) {
    EXPECT_NE(service_of(with(change.what, change.instead)).fingerprint, before) << change.instead;
  }
}

TEST(Fingerprint, IgnoresOtherMethods) {
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

}  // namespace
}  // namespace rtpm::schema
