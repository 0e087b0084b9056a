#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "scratch_folder.hpp"

// Compares generated code with the reviewed files in schema/goldens, and errors with those in
// schema/goldens/errors. After an intended change, write them with RTPM_UPDATE_GOLDENS=1 and review
// the difference.
namespace rtpm::schema {
namespace {

namespace fs = std::filesystem;

/// Changes the current folder, so that schemas are named without folder and errors do not depend on
/// where the project is.
class InFolder {
 public:
  explicit InFolder(const fs::path& folder) : before_(fs::current_path()) {
    fs::current_path(folder);
  }
  InFolder(const InFolder&) = delete;
  InFolder& operator=(const InFolder&) = delete;
  ~InFolder() { fs::current_path(before_); }

 private:
  fs::path before_;
};

std::vector<std::string> schemas_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".fbs") names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

CompileResult compile_here(const std::string& file) {
  CompileResult result = compile({.file = file, .include_paths = {RTPM_IDL_FOLDER}});
  if (!result.model) return result;
  result.errors = make_cpp_back_end("0.0.0")->check(*result.model);
  if (!result.errors.empty()) result.model.reset();
  return result;
}

TEST(Golden, GeneratedCodeIsAsReviewed) {
  const InFolder folder(RTPM_GOLDEN_FOLDER);
  const std::vector<std::string> schemas = schemas_in(".");
  ASSERT_GE(schemas.size(), 5u);
  for (const std::string& schema : schemas) {
    const CompileResult result = compile_here(schema);
    ASSERT_TRUE(result.model) << render(result.errors);
    for (const auto make : {&make_cpp_back_end, &make_python_back_end, &make_typescript_back_end}) {
      EXPECT_EQ(render(make("0.0.0")->check(*result.model)), "");
      for (const GeneratedFile& file : make("0.0.0")->generate(*result.model))
        test::expect_golden(file.name + ".golden", file.text);
    }
  }
}

// Java has a file for each class; a golden has those of one schema.
TEST(Golden, GeneratedJavaIsAsReviewed) {
  const InFolder folder(RTPM_GOLDEN_FOLDER);
  for (const std::string& schema : schemas_in(".")) {
    const CompileResult result = compile_here(schema);
    ASSERT_TRUE(result.model) << render(result.errors);
    const auto back_end = make_java_back_end("0.0.0");
    EXPECT_EQ(render(back_end->check(*result.model)), "");
    std::string text;
    for (const GeneratedFile& file : back_end->generate(*result.model))
      text += "==> " + file.name + " <==\n" + file.text;
    test::expect_golden(fs::path(schema).replace_extension(".java.golden"), text);
  }
}

// One model is enough: it has every kind of type and all attributes.
TEST(Golden, JsonIsAsReviewed) {
  const InFolder folder(RTPM_GOLDEN_FOLDER);
  const CompileResult result = compile_here("quantities.fbs");
  ASSERT_TRUE(result.model) << render(result.errors);
  for (const GeneratedFile& file : make_json_back_end("0.0.0")->generate(*result.model)) {
    test::expect_golden(file.name + ".golden", file.text);
  }
}

TEST(Golden, ErrorsAreAsReviewed) {
  const InFolder folder(fs::path(RTPM_GOLDEN_FOLDER) / "errors");
  const std::vector<std::string> schemas = schemas_in(".");
  ASSERT_GE(schemas.size(), 40u);
  for (const std::string& schema : schemas) {
    const CompileResult result = compile_here(schema);
    EXPECT_FALSE(result.model) << schema << " is taken without an error";
    test::expect_golden(fs::path(schema).replace_extension(".txt"), render(result.errors));
  }
}

TEST(Golden, EveryFileHasItsSchema) {
  for (const auto& entry : fs::recursive_directory_iterator(RTPM_GOLDEN_FOLDER)) {
    fs::path path = entry.path();
    // The schemas of these files are in tests.
    const std::string folder = path.parent_path().filename().string();
    if (folder == "conform" || folder == "commands") continue;
    if (path.extension() == ".golden") {
      const std::string name = path.filename().string();
      // "arm.rtpm.hpp.golden" and "arm_rtpm.py.golden" are of arm.fbs.
      const std::size_t stem_size = std::min(name.find('.'), name.find("_rtpm."));
      path.replace_filename(name.substr(0, stem_size) + ".fbs");
    }
    if (path.extension() == ".txt") path.replace_extension(".fbs");
    EXPECT_TRUE(fs::exists(path)) << entry.path() << " has no schema beside it: delete it";
  }
}

TEST(Golden, EveryErrorOfALineMarksIt) {
  const InFolder folder(fs::path(RTPM_GOLDEN_FOLDER) / "errors");
  for (const std::string& schema : schemas_in(".")) {
    for (const Diagnostic& error : compile_here(schema).errors) {
      if (error.location.line == 0) continue;
      EXPECT_GE(error.location.column, 1u) << render(error);
      EXPECT_NE(render(error).find('^'), std::string::npos) << render(error);
      EXPECT_NE(test::read_file(error.location.file).find(error.location.line_text),
                std::string::npos)
          << render(error);
    }
  }
}

}  // namespace
}  // namespace rtpm::schema
