#include <gtest/gtest.h>

#include <string>

#include "model/quantities.hpp"
#include "model/verify_limits.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "scratch_folder.hpp"

// The attributes of a schema in the model.
namespace rtpm::schema {
namespace {

constexpr std::string_view kSchema = R"(include "rtpm.fbs";
namespace lab;
table Pose (rtpm_event: 12) {
  x:double (rtpm_unit: "metre", rtpm_range: "-0.5..0.5", rtpm_frame: "base");
  name:string;
}
rpc_service Arm (rtpm_priority: 24000, rtpm_priority_model: "server_declared") {
  go(Pose):rtpm.Empty (rtpm_id: 1, rtpm_oneway: "received");
  reach(Pose):Pose (rtpm_id: 2, rtpm_deferred, rtpm_max_size: 256);
  watch(Pose):Pose (rtpm_id: 3, rtpm_stream);
  ask(Pose):Pose (rtpm_id: 4);
}
rpc_service Leg (rtpm_priority: 0) { ask(Pose):Pose (rtpm_id: 4); }
)";

std::string with(const std::string& what, const std::string& instead) {
  return test::replaced(kSchema, what, instead);
}

const Object& object_of(const Model& model, const std::string& name) {
  for (const Object& object : model.objects) {
    if (object.name == name) return object;
  }
  ADD_FAILURE() << name << " is not in the model";
  return model.objects.front();
}

TEST(Attributes, AreReadFromIncludedFiles) {
  const test::ScratchFolder folder;
  folder.write("base.fbs", "include \"rtpm.fbs\"; table Base { x:double (rtpm_unit: \"volt\"); }");
  const CompileResult result =
      compile({.file = folder.write("arm.fbs", "include \"base.fbs\"; table Arm { base:Base; }"),
               .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  EXPECT_EQ(object_of(*result.model, "Base").fields[0].unit, "volt");
}

TEST(Attributes, ChangeTheFingerprintIfBothSidesMustAgree) {
  const Service before = test::model_of(kSchema).services[0];
  for (const auto& [what, instead] :
       {std::pair{"\"metre\"", "\"millimetre\""}, {"\"base\"", "\"world\""}}) {
    const Service after = test::model_of(with(what, instead)).services[0];
    EXPECT_NE(before.methods[3].fingerprint, after.methods[3].fingerprint) << what;
  }
  EXPECT_NE(before.methods[0].fingerprint,
            test::model_of(with("\"received\"", "\"done\"")).services[0].methods[0].fingerprint);
  EXPECT_NE(before.methods[2].fingerprint,
            test::model_of(with(", rtpm_stream", "")).services[0].methods[2].fingerprint);
  // Limits, and attributes that each side decides alone, do not change the fingerprint.
  for (const auto& [what, instead] :
       {std::pair{"-0.5..0.5", "-1..1"}, {"rtpm_deferred, ", ""}, {"256", "512"}, {"24000", "1"}}) {
    EXPECT_EQ(before.fingerprint, test::model_of(with(what, instead)).services[0].fingerprint)
        << what;
  }
}

TEST(Attributes, EventFingerprintCoversItsNumberAndTypes) {
  const auto fingerprint = [](const std::string& text) {
    const Model model = test::model_of(text);
    return object_of(model, "lab.Pose").event_fingerprint;
  };
  const std::uint64_t before = fingerprint(std::string(kSchema));
  EXPECT_NE(before, fingerprint(with("rtpm_event: 12", "rtpm_event: 13")));
  EXPECT_NE(before, fingerprint(with("name:string", "name:[string]")));
  EXPECT_EQ(before, fingerprint(with("ask(Pose)", "inquire(Pose)")));
}

VerifyLimits limits_of(std::string_view types) {
  const Model model = test::model_of(types);
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    if (model.objects[i].name == "T") return verify_limits(model, i);
  }
  return {};
}

TEST(VerifyLimits, FollowFromTheSchema) {
  struct Case {
    const char* types;
    std::uint32_t depth;
    std::uint32_t tables;
  };
  const Case cases[] = {
      {"table T { x:int; s:string; v:[string]; }", 1, 1},
      {"struct S { x:int; } table T { s:S; v:[S]; }", 1, 1},
      {"table A { x:int; } table T { a:A; b:A; }", 2, 3},
      {"table A { x:int; } table B { a:A; } table T { b:B; a:A; }", 3, 4},
      {"table A { x:int; } table T { many:[A]; }", 2, 0},
      {"table A { x:int; } table B { a:A; } union U { A, B } table T { u:U; }", 3, 3},
      {"table A { x:int; } table T { gone:A (deprecated); }", 1, 1},
      {"table T { inner:T; }", kRecursiveDepth + 1, 0},
      {"table A { t:T; } table T { a:A; }", kRecursiveDepth + 2, 0},
  };
  for (const Case& c : cases) {
    const VerifyLimits limits = limits_of(c.types);
    EXPECT_EQ(limits.depth, c.depth) << c.types;
    EXPECT_EQ(limits.tables, c.tables) << c.types;
  }
}

// Types that contain the next one twice, which gives 2^40 paths.
TEST(VerifyLimits, DeepSchemasAreWalkedOnce) {
  std::string types = "include \"rtpm.fbs\"; table L0 { x:int (rtpm_unit: \"volt\"); }\n";
  for (int i = 1; i <= 40; ++i) {
    const std::string inner = "L" + std::to_string(i - 1);
    types += "table L" + std::to_string(i) + " { a:" + inner + "; b:" + inner + "; }\n";
  }
  types += "table T { l:L40; }";
  EXPECT_EQ(limits_of(types).depth, 42u);
  EXPECT_EQ(limits_of(types).tables, 0u);
  const Model model = test::model_of(types);
  const auto index = static_cast<std::size_t>(&object_of(model, "T") - model.objects.data());
  const Payload payload{.kind = PayloadKind::kTable, .table = index, .struct_index = std::nullopt};
  EXPECT_EQ(quantities(model, payload, "request").size(), 41u);
}

}  // namespace
}  // namespace rtpm::schema
