#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// A file to write: a name without folder, and its whole text.
struct GeneratedFile {
  std::string name{};
  std::string text{};
};

/// Turns a model into code of one language.
///
/// A new language is one class behind this interface and one flag in rtpmc. It reads the Model
/// only, never the schema's text, and writes no file itself.
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

/// C++20 stubs and skeletons: <stem>.rtpm.hpp and <stem>.rtpm.cpp. They use RTPM's headers and the
/// data types that `flatc --cpp --scoped-enums --gen-object-api` makes of the same schema.
/// `compiler_version` is stamped on the code.
[[nodiscard]] std::unique_ptr<BackEnd> make_cpp_back_end(std::string compiler_version);

}  // namespace rtpm::schema
