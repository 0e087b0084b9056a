#pragma once

#include <flatbuffers/idl.h>
#include <flatbuffers/reflection.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "evolution_schema.hpp"
#include "rtpm/schema/model.hpp"

/// Two sides of an exchange without generated code: FlatBuffers' parser writes values of a schema,
/// its reflection verifies and reads them.
namespace rtpm::schema::test {

/// A writer and reader of one version of a schema.
class Side {
 public:
  explicit Side(const SchemaText& schema);

  [[nodiscard]] const Model& model() const noexcept { return model_; }
  [[nodiscard]] const SchemaText& schema() const noexcept { return schema_; }

  /// A message of `table` with random values.
  [[nodiscard]] std::string write(const std::string& table, PayloadKind kind, Random& random);

  /// Reads the bytes, member by member; nullopt if this side rejects `verified`.
  /// @param verified     the bytes without what generated code's verifier judges differently from
  ///                     the reflection's; if empty, nothing is verified
  /// @param union_types  if given, gets the positions of unions' types
  [[nodiscard]] std::optional<nlohmann::json> read(
      const std::string& table, PayloadKind kind, const std::string& bytes,
      const std::string& verified, std::vector<std::size_t>* union_types = nullptr) const;

 private:
  SchemaText schema_;
  Model model_{};
  std::unique_ptr<flatbuffers::Parser> parser_{};
  std::string reflection_{};
};

/// Whether a reader that got `read` understood `written`: members that both know are equal, and
/// members that the writer does not know are absent.
[[nodiscard]] bool is_understood(const nlohmann::json& written, const nlohmann::json& read);

/// Whether clients of one schema and servers of the other understand each other in some calls of
/// each method with random values.
[[nodiscard]] bool can_call(Side& client, Side& server, Random& random);

}  // namespace rtpm::schema::test
