#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The name and the text of a file to write.
struct GeneratedFile {
  std::string name{};  ///< With folders where the language wants them: "lab/Force.java".
  std::string text{};
};

/// Generates the files of one target language from a model.
///
/// To add a language: derive in schema/compiler/src, read only the Model (no schema text, clock,
/// path or environment), and add a line to back_ends(). A generator outside this tree reads the
/// model as JSON: schema/model.md.
class BackEnd {
 public:
  BackEnd() = default;
  BackEnd(const BackEnd&) = delete;
  BackEnd& operator=(const BackEnd&) = delete;
  virtual ~BackEnd() = default;

  /// Reports everything that the language can't express, such as two methods with the same name.
  [[nodiscard]] virtual Diagnostics check(const Model& model) const = 0;

  /// The files for `model`, the main one first; identical on every machine.
  /// @param model  check() has reported no errors for it
  [[nodiscard]] virtual std::vector<GeneratedFile> generate(const Model& model) const = 0;
};

struct BackEndEntry {
  std::string_view name{};     ///< The value of --emit.
  std::string_view summary{};  ///< The summary in --help.
  std::unique_ptr<BackEnd> (*make)(std::string compiler_version) = nullptr;
};

/// All back ends.
[[nodiscard]] std::span<const BackEndEntry> back_ends() noexcept;

/// C++20 stubs and skeletons, as <stem>.rtpm.{hpp,functions.hpp,events.hpp,cpp}. They include the
/// data types that `flatc --cpp --scoped-enums --gen-object-api` generates from the same schema.
/// @param compiler_version  written into the code
[[nodiscard]] std::unique_ptr<BackEnd> make_cpp_back_end(std::string compiler_version);

/// Java 17 for the module org.rtpm: a file per class, in folders of packages. Needs no FlatBuffers.
[[nodiscard]] std::unique_ptr<BackEnd> make_java_back_end(std::string compiler_version);

/// The model as JSON, <stem>.rtpm.json.
/// @source schema/model.md
[[nodiscard]] std::unique_ptr<BackEnd> make_json_back_end(std::string compiler_version);

/// Python for the package `rtpm`: <stem>_rtpm.py, which has the schema as data, and <stem>_rtpm.pyi,
/// its classes for type checkers and editors.
[[nodiscard]] std::unique_ptr<BackEnd> make_python_back_end(std::string compiler_version);

/// TypeScript for the package `rtpm`: <stem>.rtpm.ts, an ES module. Needs no FlatBuffers.
[[nodiscard]] std::unique_ptr<BackEnd> make_typescript_back_end(std::string compiler_version);

}  // namespace rtpm::schema
