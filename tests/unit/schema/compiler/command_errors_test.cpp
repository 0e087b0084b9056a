#include <flatbuffers/reflection.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "rtpmc_program.hpp"

// rtpmc's errors about command lines, files and folders, with reviewed texts in goldens/commands.
// The errors about a schema's content are in goldens/errors.
namespace rtpm::schema::test {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kGood =
    "include \"rtpm.fbs\";\nnamespace lab;\ntable Maybe { number:int = null; }\n"
    "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }\n";
constexpr std::string_view kBad =
    "include \"rtpm.fbs\";\nnamespace lab;\n"
    "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty; }\n";

/// Expects the reviewed error, its exit code, and no output file.
void expect_error(const ScratchFolder& folder, const std::string& name,
                  const std::string& arguments, int exit_code = 1) {
  SCOPED_TRACE(name);
  const Outcome result = run(folder, arguments);
  EXPECT_EQ(result.exit_code, exit_code) << result.errors;
  EXPECT_EQ(result.output, "");
  EXPECT_TRUE(names_in(folder.path() / "out").empty());
  std::string errors = result.errors;
  const std::string idl = RTPM_IDL_FOLDER;
  for (std::size_t at = errors.find(idl); at != std::string::npos; at = errors.find(idl)) {
    errors.replace(at, idl.size(), "IDL");
  }
  expect_golden(fs::path(RTPM_GOLDEN_FOLDER) / "commands" / (name + ".txt"), errors);
}

const std::string kGenerate = idl_flag() + "--cpp -o out --depfile out/arm.d ";

TEST(RtpmcErrors, DescribeUnreadableSchemas) {
  const ScratchFolder folder;
  expect_error(folder, "missing_schema", kGenerate + "none.fbs");
  fs::create_directory(folder.path() / "folder.fbs");
  expect_error(folder, "folder_as_schema", kGenerate + "folder.fbs");
  folder.write("huge.fbs", std::string(kGood) + std::string(17 * 1024 * 1024, ' '));
  expect_error(folder, "huge_schema", kGenerate + "huge.fbs");
  folder.write("zero.fbs", std::string(kGood) + std::string(1, '\0'));
  expect_error(folder, "zero_byte", kGenerate + "zero.fbs");
  folder.write("deep.fbs", "table T { x:" + std::string(100'000, '[') + "int; }\n");
  EXPECT_EQ(run(folder, kGenerate + "deep.fbs").exit_code, 1);
  fs::create_directory(folder.path() / "my schemas");
  folder.write("my schemas/the arm.fbs", kBad);
  expect_error(folder, "path_with_spaces", kGenerate + "'my schemas/the arm.fbs'");
}

TEST(RtpmcErrors, DescribeBinarySchemasOfOtherCompilers) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  make_binary(folder, "");
  expect_error(folder, "binary_without_names", kGenerate + "arm.bfbs");
  make_binary(folder);
  std::string bytes = read_file(folder.path() / "arm.bfbs");
  folder.write("cut.bfbs", std::string_view(bytes).substr(0, 100));
  expect_error(folder, "binary_of_another_version", kGenerate + "cut.bfbs");
  // A feature of a newer FlatBuffers; the schema has one already, so the field is present.
  auto* const features = const_cast<std::uint8_t*>(
      reinterpret_cast<const flatbuffers::Table*>(reflection::GetSchema(bytes.data()))
          ->GetAddressOf(reflection::Schema::VT_ADVANCED_FEATURES));
  ASSERT_NE(features, nullptr);
  features[0] |= 0x20;
  folder.write("later.bfbs", bytes);
  expect_error(folder, "unknown_feature", kGenerate + "later.bfbs");
}

TEST(RtpmcErrors, DescribeUnwritableOutput) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  folder.write("file", "a file where a folder should be");
  expect_error(folder, "folder_is_a_file", idl_flag() + "--cpp -o file arm.fbs");
  // The last file cannot be written, so no file is.
  fs::create_directories(folder.path() / "half/arm.rtpm.cpp");
  expect_error(folder, "file_is_a_folder", idl_flag() + "--cpp -o half arm.fbs");
  EXPECT_EQ(names_in(folder.path() / "half"), std::vector<std::string>{"arm.rtpm.cpp"});
  expect_error(folder, "no_such_device", idl_flag() + "--cpp -o /dev/null/out arm.fbs");
}

TEST(RtpmcErrors, DescribeWrongCommandLines) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  expect_error(folder, "no_arguments", "", 2);
  expect_error(folder, "unknown_option", kGenerate + "--fast arm.fbs", 2);
  expect_error(folder, "unknown_back_end", "--emit fortran -o out arm.fbs", 2);
  expect_error(folder, "two_schemas", kGenerate + "arm.fbs leg.fbs", 2);
  expect_error(folder, "no_output_folder", idl_flag() + "--cpp arm.fbs", 2);
  expect_error(folder, "missing_older_schema",
               "check " + idl_flag() + "--conform none.fbs arm.fbs");
}

/// The C++ compiler's errors about the generated header in `folder`.
std::string refusal_of_header(const ScratchFolder& folder, const std::string& standard) {
  const std::string command = "cd " + quoted(folder.path().string()) + " && " +
                              quoted(RTPM_COMPILER) + " -std=" + standard +
                              " -fsyntax-only -I code -x c++ code/arm.rtpm.hpp 2> errors";
  EXPECT_NE(std::system(command.c_str()), 0);
  return read_file(folder.path() / "errors");
}

TEST(RtpmcErrors, DescribeAnOlderLanguageInOneSentence) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  ASSERT_EQ(run(folder, idl_flag() + "--cpp -o code arm.fbs").exit_code, 0);
  const std::string errors = refusal_of_header(folder, "c++17");
  expect_text(errors, {"RTPM needs C++20"});
  EXPECT_EQ(errors.find("error:"), errors.rfind("error:")) << errors;
}

// The versions of generated code and of RTPM's headers differ.
TEST(RtpmcErrors, DescribeCodeForAnotherRuntime) {
  const ScratchFolder folder;
  folder.write("arm.fbs", kGood);
  ASSERT_EQ(run(folder, idl_flag() + "--cpp -o code arm.fbs").exit_code, 0);
  folder.write("code/arm_generated.h", "");
  fs::create_directories(folder.path() / "code/rtpm/rpc");
  folder.write("code/rtpm/rpc/generated.hpp",
               "namespace rtpm::rpc { inline constexpr int kGeneratedForm = 0; }\n");
  expect_text(refusal_of_header(folder, "c++20"), {"run it again for arm.fbs"});
}

}  // namespace
}  // namespace rtpm::schema::test
