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

/// The kind of the request of the only method.
PayloadKind kind_of(const std::string& types, const std::string& request = "Request") {
  const Model model = model_of(
      in_lab(types + "rpc_service Arm { call(" + request + "):rtpm.Empty (rtpm_id: 1); }"));
  return model.services.empty() ? PayloadKind::kEmpty : model.services[0].methods[0].request.kind;
}

TEST(PayloadRule, RtpmEmptyIsEmpty) {
  EXPECT_EQ(kind_of("", "rtpm.Empty"), PayloadKind::kEmpty);
}

TEST(PayloadRule, AnotherTableWithoutFieldsIsATable) {
  EXPECT_EQ(kind_of("table Request {}"), PayloadKind::kTable);
}

TEST(PayloadRule, OneRequiredStructIsAStruct) {
  EXPECT_EQ(kind_of("struct S { x:int; } table Request { s:S (required); }"), PayloadKind::kStruct);
}

TEST(PayloadRule, OneOptionalStructIsATable) {
  EXPECT_EQ(kind_of("struct S { x:int; } table Request { s:S; }"), PayloadKind::kTable);
}

TEST(PayloadRule, ARequiredStructAndMoreIsATable) {
  EXPECT_EQ(kind_of("struct S { x:int; } table Request { s:S (required); more:int; }"),
            PayloadKind::kTable);
  EXPECT_EQ(kind_of("struct S { x:int; } table Request { old:int (deprecated); s:S (required); }"),
            PayloadKind::kTable);
}

TEST(PayloadRule, ARequiredTableOrVectorIsATable) {
  EXPECT_EQ(kind_of("table T { x:int; } table Request { t:T (required); }"), PayloadKind::kTable);
  EXPECT_EQ(kind_of("struct S { x:int; } table Request { s:[S] (required); }"),
            PayloadKind::kTable);
}

TEST(Model, HasServicesAndMethodsAsDeclared) {
  const Model model = model_of(in_lab(R"(
rpc_service Zebra {
  z(rtpm.Empty):rtpm.Empty (rtpm_id: 9);
  a(rtpm.Empty):rtpm.Empty (rtpm_id: 3);
  m(rtpm.Empty):rtpm.Empty (rtpm_id: 5);
}
rpc_service Ant { a(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }
)"));
  ASSERT_EQ(model.services.size(), 2u);
  EXPECT_EQ(model.services[0].name, "lab.Zebra");
  EXPECT_EQ(model.services[1].name, "lab.Ant");
  ASSERT_EQ(model.services[0].methods.size(), 3u);
  EXPECT_EQ(model.services[0].methods[0].name, "z");
  EXPECT_EQ(model.services[0].methods[1].name, "a");
  EXPECT_EQ(model.services[0].methods[2].name, "m");
  EXPECT_EQ(model.services[0].methods[2].id, 5);
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

TEST(Model, FindsIncludedFilesByALinkToo) {
  const test::ScratchFolder folder;
  folder.write("real/arm.fbs",
               in_lab("rpc_service Arm { a(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }"));
  std::filesystem::create_directory_symlink(folder.path() / "real", folder.path() / "link");
  const CompileResult result = compile(
      {.file = (folder.path() / "link/arm.fbs").string(), .include_paths = {RTPM_IDL_FOLDER}});
  ASSERT_TRUE(result.model) << render(result.errors);
  EXPECT_EQ(result.model->services.size(), 1u);
}

TEST(Model, HasAttributes) {
  const Model model = model_of(in_lab(R"(
rpc_service Arm {
  a(rtpm.Empty):rtpm.Empty (rtpm_id: 65535, rtpm_idempotent, rtpm_deadline_us: 800);
  b(rtpm.Empty):rtpm.Empty (rtpm_id: "7");
})"));
  const Method& a = model.services.at(0).methods.at(0);
  EXPECT_EQ(a.id, 65535);
  EXPECT_TRUE(a.is_idempotent);
  EXPECT_EQ(a.deadline_us, 800u);
  const Method& b = model.services.at(0).methods.at(1);
  EXPECT_EQ(b.id, 7);
  EXPECT_FALSE(b.is_idempotent);
  EXPECT_EQ(b.deadline_us, std::nullopt);
}

TEST(Model, HasDocumentationAndPlaces) {
  const Model model =
      model_of(in_lab("/// An arm.\n/// Or a leg.\nrpc_service Arm {\n"
                      "  /// Stops.\n  stop(rtpm.Empty):rtpm.Empty (rtpm_id: 1);\n}\n"));
  const Service& service = model.services.at(0);
  EXPECT_EQ(service.documentation, (Documentation{" An arm.", " Or a leg."}));
  EXPECT_EQ(service.location.line, 5u);
  EXPECT_EQ(service.location.column, 13u);
  EXPECT_EQ(service.methods.at(0).documentation, Documentation{" Stops."});
  EXPECT_EQ(service.methods.at(0).location.line, 7u);
  EXPECT_EQ(service.methods.at(0).location.column, 3u);
}

TEST(Model, HasItsDependencies) {
  const test::ScratchFolder folder;
  folder.write("deep.fbs", "namespace lab; table Deep { x:int; }");
  folder.write("base.fbs", "include \"deep.fbs\";\nnamespace lab; table Base { d:Deep; }");
  const std::string file =
      folder.write("arm.fbs", "include \"base.fbs\";\nnamespace lab; table Arm { b:Base; }");
  const CompileResult result = compile({.file = file, .include_paths = {}});
  ASSERT_TRUE(result.model) << render(result.errors);
  ASSERT_EQ(result.model->source_files.size(), 3u);
  EXPECT_EQ(result.model->source_files[0], file);
}

// Comments, strings and odd spacing must not confuse the search for positions.
TEST(Checker, FindsPlacesInOddText) {
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
  EXPECT_NE(errors.find("`m0`"), std::string::npos);
  EXPECT_NE(errors.find("`m19`"), std::string::npos);
  EXPECT_EQ(errors.find("`m20`"), std::string::npos);
  EXPECT_NE(errors.find("and 5 more errors"), std::string::npos);
}

TEST(Checker, RefusesAZeroByte) {
  const std::string errors = errors_of(in_lab(std::string(1, '\0') + "table T { x:int; }"));
  EXPECT_NE(errors.find("arm.fbs:3:1: error: a zero byte"), std::string::npos) << errors;
}

TEST(Checker, AcceptsRecursiveTypes) {
  const Model model =
      model_of(in_lab("union Any { Tree }\n"
                      "table Tree { left:Tree; right:Tree; any:Any; others:[Tree]; }\n"
                      "rpc_service Arm { grow(Tree):Tree (rtpm_id: 1); }"));
  EXPECT_EQ(model.services.size(), 1u);
}

TEST(Checker, AcceptsALargeSchema) {
  std::string text = in_lab("");
  for (int s = 0; s < 200; ++s) {
    const std::string n = std::to_string(s);
    text.append("table Request").append(n).append(" { name:string; value:int; }\n");
    text.append("rpc_service Service").append(n).append(" {\n");
    for (int m = 1; m <= 10; ++m) {
      const std::string id = std::to_string(m);
      text.append("  m").append(id).append("(Request").append(n);
      text.append("):rtpm.Empty (rtpm_id: ").append(id).append(");\n");
    }
    text += "}\n";
  }
  EXPECT_EQ(model_of(text).services.size(), 200u);
}

}  // namespace
}  // namespace rtpm::schema
