#include "program/command_line.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/output.hpp"
#include "rtpmc_program.hpp"
#include "scratch_folder.hpp"

// rtpmc as a program: command line, output, messages and exit codes.
namespace rtpm::schema::test {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kGood =
    "include \"rtpm.fbs\";\nnamespace lab;\n"
    "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }\n";
constexpr std::string_view kBad =
    "include \"rtpm.fbs\";\nnamespace lab;\n"
    "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty; }\n";

TEST(Rtpmc, WritesItsFilesIntoANewFolderWithSpaces) {
  const ScratchFolder folder;
  folder.write("a dir/my arm.fbs", kGood);
  const Outcome result = run(folder, idl_flag() + "--cpp -o 'out dir/deep' 'a dir/my arm.fbs'");
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  EXPECT_EQ(names_in(folder.path() / "out dir/deep").size(), 4u);
  const std::string header = read_file(folder.path() / "out dir/deep/my arm.rtpm.hpp");
  expect_text(header, {"class ArmClient"});
  EXPECT_NE(read_file(folder.path() / "out dir/deep/my arm.rtpm.cpp").find(RTPM_VERSION),
            std::string::npos);
}

TEST(Rtpmc, SchemaErrorKeepsTheOldFiles) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  ASSERT_EQ(run(folder, idl_flag() + "--cpp -o out arm.fbs").exit_code, 0);
  const std::string before = read_file(folder.path() / "out/arm.rtpm.hpp");
  folder.write("arm.fbs", kBad);
  EXPECT_EQ(run(folder, idl_flag() + "--cpp -o out arm.fbs").exit_code, 1);
  EXPECT_EQ(read_file(folder.path() / "out/arm.rtpm.hpp"), before);
  EXPECT_EQ(names_in(folder.path() / "out").size(), 4u);
}

TEST(Rtpmc, DependencyFileHasIncludedFiles) {
  const ScratchFolder folder;
  folder.write("in c/base.fbs", "namespace lab; table Base { x:int; }");
  folder.write("arm.fbs", "include \"base.fbs\";\n" + std::string(kGood));
  const Outcome result =
      run(folder, idl_flag() + "-I 'in c' --cpp -o 'o ut' --depfile arm.d arm.fbs");
  ASSERT_EQ(result.exit_code, 0) << result.errors;
  const std::string text = read_file(folder.path() / "arm.d");
  EXPECT_TRUE(
      text.starts_with("o\\ ut/arm.rtpm.hpp o\\ ut/arm.rtpm.functions.hpp "
                       "o\\ ut/arm.rtpm.events.hpp o\\ ut/arm.rtpm.cpp: \\\n  arm.fbs"))
      << text;
  expect_text(text, {"in\\ c/base.fbs", "rtpm.fbs"});
}

TEST(Rtpmc, DependencyFileEscapesForMake) {
  EXPECT_EQ(dependency_text({"a b", "c"}, {"$x", "#y", "d\\e"}),
            "a\\ b c: \\\n  $$x \\\n  \\#y \\\n  d\\\\e\n");
}

// The methods get an underscore; both headers compile with what the GNU dialect defines.
TEST(Rtpmc, MethodsMayHaveNamesOfMacros) {
  const ScratchFolder folder;
  const std::vector<std::string> names{"EOF",    "NULL",     "errno",   "assert", "linux",
                                       "unix",   "stdin",    "INT_MAX", "EIO",    "NAN",
                                       "alloca", "offsetof", "LC_ALL",  "SIGINT", "__FILE__"};
  std::string schema = "include \"rtpm.fbs\"; namespace lab; rpc_service Arm {\n";
  for (std::size_t i = 0; i < names.size(); ++i) {
    schema += names[i] + "(rtpm.Empty):rtpm.Empty (rtpm_id: " + std::to_string(i + 1) + ");\n";
  }
  folder.write("arm.fbs", schema + "}\n");
  ASSERT_EQ(run(folder, idl_flag() + "--cpp -o code arm.fbs").exit_code, 0);
  folder.write("code/arm_generated.h", "");
  const std::string header = read_file(folder.path() / "code/arm.rtpm.hpp");
  for (const std::string& name : names)
    EXPECT_NE(header.find(' ' + name + "_("), std::string::npos) << name;
}

TEST(Rtpmc, CheckRefusesWhatCppRefuses) {
  const ScratchFolder folder;
  for (const auto& entry : fs::directory_iterator(fs::path(RTPM_GOLDEN_FOLDER) / "errors")) {
    if (entry.path().extension() != ".fbs") continue;
    const std::string schema = quoted(entry.path().string());
    const Outcome checked = run(folder, "check " + idl_flag() + schema);
    EXPECT_EQ(checked.exit_code, 1) << schema;
    EXPECT_EQ(checked.errors, run(folder, idl_flag() + "--cpp -o out " + schema).errors);
  }
}

TEST(Rtpmc, FindsRtpmsOwnSchemasByItself) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  EXPECT_EQ(run(folder, "check arm.fbs").errors, "");
  EXPECT_EQ(run(folder, "--cpp -o out arm.fbs").exit_code, 0);
}

TEST(Rtpmc, PrintsHelpAndVersion) {
  const ScratchFolder folder;
  const Outcome help = run(folder, "--help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_TRUE(help.output.starts_with("usage: rtpmc")) << help.output;
  const Outcome idl = run(folder, "--print-idl-folder");
  EXPECT_EQ(idl.exit_code, 0);
  EXPECT_TRUE(fs::exists(fs::path(idl.output.substr(0, idl.output.find('\n'))) / "rtpm.fbs"));
  const Outcome version = run(folder, "--version");
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_EQ(version.output, std::string("rtpmc ") + RTPM_VERSION + '\n');
}

TEST(Rtpmc, WrongCommandLineIsOneSentenceAndExitCodeTwo) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"--cpp -o out --pyhton arm.fbs", "unknown flag `--pyhton`: rtpmc --help lists"},
      {"--cpp -o out", "no schema is given: add a FILE.fbs"},
      {"-o out arm.fbs", "no language is given: add --cpp"},
      {"--cpp arm.fbs -o", "`-o` needs a path behind it"},
      {"--cpp -o a -o b arm.fbs", "`-o` is given twice"},
      {"--cpp -o out -I", "`-I` needs a path behind it"},
      {"--emit", "`--emit` needs a language behind it"},
      {"--emit pascal -o out arm.fbs", "unknown language `pascal`"},
      {"--emit json --cpp arm.fbs", "no output folder is given: add -o OUT"},
      {"--emit json --depfile d arm.fbs", "no output folder is given: add -o OUT"},
      {"check --cpp arm.fbs", "`check` generates nothing"},
      {"check", "no schema is given"},
      {"check --strict arm.fbs", "`--strict` says how to compare"},
  };
  for (const auto& [arguments, sentence] : wrong) {
    const Outcome result = run(folder, arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_TRUE(result.errors.starts_with("rtpmc: error: " + sentence)) << result.errors;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

TEST(Rtpmc, PrintsTheModelOrWritesIt) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  const Outcome printed = run(folder, idl_flag() + "--emit json arm.fbs");
  EXPECT_EQ(printed.exit_code, 0) << printed.errors;
  const auto model = nlohmann::json::parse(printed.output);
  EXPECT_EQ(model["format"], "rtpm-model");
  EXPECT_EQ(model["format_version"], 1);
  EXPECT_EQ(model["services"][0]["methods"][0]["id"], 1);

  ASSERT_EQ(run(folder, idl_flag() + "--emit json --cpp -o out arm.fbs").exit_code, 0);
  EXPECT_EQ(read_file(folder.path() / "out/arm.rtpm.json"), printed.output);
  EXPECT_EQ(names_in(folder.path() / "out").size(), 5u);
}

// The comment has quotation marks, backslashes and control characters.
TEST(Rtpmc, JsonEscapesAnyComment) {
  const ScratchFolder folder;
  folder.write("arm.fbs", "/// a \"quoted\" back\\slash\tand \x01\ntable T { x:double = inf; }\n");
  const Outcome printed = run(folder, "--emit json arm.fbs");
  const auto model = nlohmann::json::parse(printed.output);
  EXPECT_EQ(model["objects"][0]["documentation"][0], " a \"quoted\" back\\slash\tand \x01");
  EXPECT_EQ(model["objects"][0]["fields"][0]["default"], "inf");
}

TEST(Rtpmc, AcceptsABinarySchema) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  make_binary(folder);
  ASSERT_EQ(run(folder, idl_flag() + "--cpp -o text arm.fbs").exit_code, 0);
  const Outcome result = run(folder, "--cpp -o binary --depfile arm.d arm.bfbs");
  ASSERT_EQ(result.exit_code, 0) << result.errors;
  for (const char* file : {"arm.rtpm.hpp", "arm.rtpm.cpp"}) {
    EXPECT_EQ(read_file(folder.path() / "text" / file), read_file(folder.path() / "binary" / file));
  }
  expect_text(read_file(folder.path() / "arm.d"), {"arm.bfbs"});
}

TEST(Rtpmc, BinarySchemaIsCheckedToo) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kBad);
  make_binary(folder);
  const Outcome result = run(folder, "--cpp -o out arm.bfbs");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_TRUE(
      result.errors.starts_with("arm.bfbs: error: method `stop` of service `lab.Arm` has "
                                "no rtpm_id\nhint: give it"))
      << result.errors;
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

TEST(Rtpmc, ChecksASchemaAndWritesNothing) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  const Outcome good = run(folder, "check " + idl_flag() + "arm.fbs");
  EXPECT_EQ(good.exit_code, 0) << good.errors;
  EXPECT_EQ(good.errors + good.output, "");
  EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"arm.fbs"});
  folder.write("arm.fbs", kBad);
  EXPECT_EQ(run(folder, "check " + idl_flag() + "arm.fbs").exit_code, 1);
}

TEST(Rtpmc, ReportsWhetherASchemaConforms) {
  const ScratchFolder folder;
  const std::string good(kGood);
  folder.write("old.fbs", good);
  const auto conform = [&](const std::string& text, const std::string& flags) {
    folder.write("new.fbs", text);
    return run(folder, flags + idl_flag() + "--conform old.fbs new.fbs");
  };
  std::string more = good;
  more.insert(more.find(" }"), " go(rtpm.Empty):rtpm.Empty (rtpm_id: 2);");
  std::string less = good;
  less.replace(less.find("rtpm_id: 1"), 10, "rtpm_id: 2");

  EXPECT_EQ(conform(good, "check ").exit_code, 0);
  const Outcome warned = conform(more, "check ");
  EXPECT_EQ(warned.exit_code, 0);
  expect_text(warned.errors, {"new.fbs:3:61: warning: method `go` of service `lab.Arm` is new"});
  EXPECT_EQ(conform(more, "check --strict ").exit_code, 1);
  const Outcome refused = conform(less, "check ");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_TRUE(
      refused.errors.starts_with("new.fbs:3:19: error: method `stop` of service `lab.Arm` "
                                 "had the number 1, and has 2"))
      << refused.errors;

  EXPECT_EQ(conform(more, "--cpp -o out --depfile d ").exit_code, 0);
  expect_text(read_file(folder.path() / "d"), {"old.fbs"});
  EXPECT_EQ(conform(less, "--cpp -o none ").exit_code, 1);
  EXPECT_FALSE(fs::exists(folder.path() / "none"));
  folder.write("old.fbs", kBad);
  EXPECT_EQ(conform(good, "check ").exit_code, 1);
}

}  // namespace
}  // namespace rtpm::schema::test
