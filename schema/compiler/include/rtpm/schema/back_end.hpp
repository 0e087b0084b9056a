#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// A file to write: a name without folder, and its whole text.
struct GeneratedFile {
  std::string name{};
  std::string text{};
};

/// Turns a model into files: model in, texts out. Each language is one class behind this interface.
///
/// To write one: derive from BackEnd in schema/compiler/src, read the Model and nothing else (never
/// the schema's text, a clock, a path of the machine or the environment), return the texts, and add
/// a line to back_ends(); `rtpmc --emit NAME` then writes them, all or none. Whoever writes a
/// generator outside of this tree reads the same model as JSON: schema/model.md.
class BackEnd {
 public:
  BackEnd() = default;
  BackEnd(const BackEnd&) = delete;
  BackEnd& operator=(const BackEnd&) = delete;
  virtual ~BackEnd() = default;

  /// What this language cannot express, such as two methods that would get the same name. Called
  /// before generate(), which may then rely on there being none.
  [[nodiscard]] virtual Diagnostics check(const Model& model) const = 0;

  /// The files of `model`, the main one first. The same model gives the same text on every machine.
  [[nodiscard]] virtual std::vector<GeneratedFile> generate(const Model& model) const = 0;
};

/// What a back end can be chosen by.
struct BackEndEntry {
  std::string_view name{};     ///< Behind --emit.
  std::string_view summary{};  ///< For --help.
  std::unique_ptr<BackEnd> (*make)(std::string compiler_version) = nullptr;
};

/// All back ends there are.
[[nodiscard]] std::span<const BackEndEntry> back_ends() noexcept;

/// C++20 stubs and skeletons: <stem>.rtpm.hpp and <stem>.rtpm.cpp. They use RTPM's headers and the
/// data types that `flatc --cpp --scoped-enums --gen-object-api` makes of the same schema.
/// `compiler_version` is stamped on the code.
[[nodiscard]] std::unique_ptr<BackEnd> make_cpp_back_end(std::string compiler_version);

/// The model itself as JSON, <stem>.rtpm.json, in the form that schema/model.md describes.
[[nodiscard]] std::unique_ptr<BackEnd> make_json_back_end(std::string compiler_version);

}  // namespace rtpm::schema
