#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "emit/name_scope.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "scratch_folder.hpp"

// Names of Java and TypeScript, and what they can't express; goldens and exchange/ have the rest.
namespace rtpm::schema {
namespace {

using test::expect_text;

std::string java_of(const std::string& text, const std::string& file) {
  const Model model = test::model_of(text);
  const auto back_end = make_java_back_end("0.0.0");
  EXPECT_EQ(render(back_end->check(model)), "");
  for (const GeneratedFile& one : back_end->generate(model)) {
    if (one.name == file) return one.text;
  }
  ADD_FAILURE() << file << " is not generated";
  return {};
}

std::string typescript_of(const Model& model) {
  const auto back_end = make_typescript_back_end("0.0.0");
  EXPECT_EQ(render(back_end->check(model)), "");
  return back_end->generate(model).at(0).text;
}

std::string java_errors(const std::string& text) {
  return render(make_java_back_end("0.0.0")->check(test::model_of(text)));
}

std::string typescript_errors(const std::string& text) {
  return render(make_typescript_back_end("0.0.0")->check(test::model_of(text)));
}

TEST(EmittedNames, FollowTheLanguage) {
  EXPECT_EQ(emit::camel("get_position"), "getPosition");
  EXPECT_EQ(emit::camel("GetPosition"), "getPosition");
  EXPECT_EQ(emit::camel("signed_8"), "signed8");
  EXPECT_EQ(emit::camel("_own"), "_own");
  EXPECT_EQ(emit::camel("from_"), "from_");
  EXPECT_EQ(emit::upper_snake("FreeMotion"), "FREE_MOTION");
  EXPECT_EQ(emit::upper_snake("free_motion"), "FREE_MOTION");
  EXPECT_EQ(emit::upper_snake("PcmS16"), "PCM_S16");
  EXPECT_EQ(emit::upper_snake("USBError"), "USB_ERROR");
}

TEST(EmittedJava, HasTheFoldersOfItsPackages) {
  const std::string schema = "namespace lab.arms; struct Vec { x:double; }";
  expect_text(java_of(schema, "lab/arms/Vec.java"), {"package lab.arms;", "record Vec(double x)"});
  // Java cannot import what is in no package.
  expect_text(java_of("struct Vec { x:double; }", "arm/Vec.java"), {"package arm;"});
}

TEST(EmittedJava, EscapesWhatAMemberWouldHide) {
  expect_text(java_of("namespace lab; struct Vec { lab:int; wait:int; toString:int; x:int; }",
                      "lab/Vec.java"),
              {"record Vec(int lab_, int wait_, int toString_, int x)"});
  expect_text(java_of("namespace lab; table String { s:string; }", "lab/String_.java"),
              {"public record String_(String s)", "\"lab.String\""});
}

TEST(EmittedJava, ReportsNamesThatClash) {
  expect_text(java_errors("table T { a_b:int; aB:int; }"),
              {"field `aB` becomes `aB` in Java, as field `a_b` does", "rename one of the two"});
  expect_text(java_errors("enum E : byte { FreeMotion, FREE_MOTION }"),
              {"value `FREE_MOTION` becomes `FREE_MOTION` in Java"});
  expect_text(java_errors("include \"rtpm.fbs\";\ntable ArmClient { x:int; }\n"
                          "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }\n"),
              {"service `Arm` becomes `arm.ArmClient` in Java, as table `ArmClient` does"});
}

TEST(EmittedJava, RefusesARecordWithTooManyComponents) {
  std::string schema = "table Large {\n";
  for (int i = 0; i < 128; ++i)
    schema += "  f" + std::to_string(i) + ":double;\n";
  expect_text(java_errors(schema + "}\n"),
              {"table `Large` has more fields than a record of Java takes", "nest some of them"});
}

TEST(EmittedTypeScript, NamesTypesOfIncludedFiles) {
  const test::ScratchFolder folder;
  folder.write("units.fbs", "namespace units; struct Vec { x:double; } struct Metre { x:double; }");
  const std::string file =
      folder.write("arm.fbs",
                   "include \"units.fbs\"; namespace arm;\nstruct Vec { x:float; }\n"
                   "table Move { a:units.Vec; b:Vec; c:units.Metre; }\n");
  const CompileResult result = compile({.file = file, .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  expect_text(typescript_of(*result.model),
              {"import { Metre, Vec as units_Vec } from \"./units.rtpm.js\";",
               "  a: units_Vec | undefined;\n  b: arm_Vec | undefined;\n  c: Metre | undefined;"});
}

TEST(EmittedTypeScript, ReportsNamesThatClash) {
  expect_text(typescript_errors("table T { a_b:int; aB:int; }"),
              {"field `aB` becomes `aB` in TypeScript, as field `a_b` does"});
  expect_text(typescript_errors("include \"rtpm.fbs\";\ntable Hit (rtpm_event: 7) { x:int; }\n"
                                "table HitEvent { x:int; }\n"),
              {"becomes `HitEvent` in TypeScript"});
}

TEST(EmittedDefaults, KeepLargeUnsignedNumbers) {
  const std::string schema =
      "enum Axes : ulong (bit_flags) { X, Last = 63 }\n"
      "table T { a:ulong = 18446744073709551615; b:ulong = 9223372036854775807; c:Axes = Last; }\n";
  const Model model = test::model_of(schema);
  expect_text(typescript_of(model), {"fields.a ?? 18446744073709551615n",
                                     "fields.b ?? 9223372036854775807n", "fields.c ?? Axes.Last"});
  expect_text(java_of(schema, "arm/T.java"), {"a = -1L;", "c = Axes.LAST;"});
  expect_text(make_json_back_end("0.0.0")->generate(model).at(0).text,
              {"\"default\": 18446744073709551615", "\"default\": 9223372036854775808"});
}

}  // namespace
}  // namespace rtpm::schema
