#include "rtpm/schema/model.hpp"

#include <gtest/gtest.h>

#include <string>

#include "scratch_folder.hpp"

namespace rtpm::schema {
namespace {

using test::errors_of;
using test::model_of;

/// A schema with the usual beginning.
std::string in_lab(const std::string& text) {
  return "include \"rtpm.fbs\";\nnamespace lab;\n" + text;
}

TEST(Model, GivesEachRequestItsKind) {
  const std::string s = "struct S { x:int; } ";
  for (const auto& [types, kind] :
       {std::pair{std::string("table Request {}"), PayloadKind::kTable},
        {s + "table Request { s:S (required); }", PayloadKind::kStruct},
        {s + "table Request { s:S; }", PayloadKind::kTable},
        {s + "table Request { s:S (required); more:int; }", PayloadKind::kTable},
        {s + "table Request { old:int (deprecated); s:S (required); }", PayloadKind::kTable},
        {s + "table Request { s:[S] (required); }", PayloadKind::kTable},
        {"table T { x:int; } table Request { t:T (required); }", PayloadKind::kTable}}) {
    const Model model =
        model_of(in_lab(types + "rpc_service Arm { call(Request):rtpm.Empty (rtpm_id: 1); }"));
    ASSERT_EQ(model.services.size(), 1u);
    EXPECT_EQ(model.services[0].methods[0].request.kind, kind) << types;
    EXPECT_EQ(model.services[0].methods[0].reply.kind, PayloadKind::kEmpty);
  }
}

TEST(Model, HasOnlyTheServicesThatTheFileItselfDeclares) {
  const test::ScratchFolder folder;
  folder.write("base.fbs", in_lab("rpc_service Base { a(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }"));
  const std::string file =
      folder.write("arm.fbs",
                   "include \"base.fbs\";\nnamespace lab;\n"
                   "rpc_service Arm { a(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }");
  const CompileResult result = compile({.file = file, .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  ASSERT_EQ(result.model->services.size(), 1u);
  EXPECT_EQ(result.model->services[0].name, "lab.Arm");
}

TEST(Model, FindsIncludedFilesThroughALink) {
  const test::ScratchFolder folder;
  folder.write("real/arm.fbs",
               in_lab("rpc_service Arm { a(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }"));
  std::filesystem::create_directory_symlink(folder.path() / "real", folder.path() / "link");
  const CompileResult result = compile(
      {.file = (folder.path() / "link/arm.fbs").string(), .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  EXPECT_EQ(result.model->services.size(), 1u);
}

// Comments, strings and odd spacing must not confuse the search for positions.
TEST(Checker, FindsPositionsInOddText) {
  const std::string errors = errors_of(
      "\xEF\xBB\xBF/* rpc_service Wrong { */ include \"rtpm.fbs\"; namespace lab . arms ;\n"
      "/* rpc_service Arm { stop(rtpm.Empty):rtpm.Empty; } */ // rpc_service Arm {\n"
      "rpc_service\n"
      "  Arm\n"
      "{ stop ( rtpm . Empty ) : rtpm . Empty // (rtpm_id: 1)\n"
      "  ; }\n");
  EXPECT_TRUE(errors.starts_with(
      "arm.fbs:5:3: error: method `stop` of service `lab.arms.Arm` has no rtpm_id"))
      << errors;
}

TEST(Checker, ReportsEveryBreachUpToTwenty) {
  std::string text = in_lab("rpc_service Arm {\n");
  for (int i = 0; i < 25; ++i)
    text += "  m" + std::to_string(i) + "(rtpm.Empty):rtpm.Empty;\n";
  const std::string errors = errors_of(text + "}\n");
  test::expect_text(errors, {"`m0`", "`m19`"});
  EXPECT_EQ(errors.find("`m20`"), std::string::npos);
  test::expect_text(errors, {"and 5 more errors"});
}

}  // namespace
}  // namespace rtpm::schema
