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

/// Two sides that were built from schemas, without their code: FlatBuffers' parser writes values as
/// a schema says, its reflection verifies and reads them.
namespace rtpm::schema::test {

/// One version of a schema, with the right to write and to read.
class Side {
 public:
  explicit Side(const SchemaText& schema);

  [[nodiscard]] const Model& model() const noexcept { return model_; }
  [[nodiscard]] const SchemaText& schema() const noexcept { return schema_; }

  /// A message of `table`, as `kind` says, with values at random.
  [[nodiscard]] std::string write(const std::string& table, PayloadKind kind, Random& random);

  /// What this side reads in the bytes, member by member; nothing if it does not take `verified`,
  /// which is the same but for what the verifier of the reflection and that of generated code judge
  /// differently; empty: the bytes are believed. Adds the places of unions' types to `union_types`,
  /// if given.
  [[nodiscard]] std::optional<nlohmann::json> read(
      const std::string& table, PayloadKind kind, const std::string& bytes,
      const std::string& verified, std::vector<std::size_t>* union_types = nullptr) const;

 private:
  SchemaText schema_;
  Model model_{};
  std::unique_ptr<flatbuffers::Parser> parser_{};
  std::string reflection_{};
};

/// Whether a reader that got `read` understood what the writer meant by `written`: every member
/// that both know is the same, and what the writer does not know is as if it was not sent.
[[nodiscard]] bool is_understood(const nlohmann::json& written, const nlohmann::json& read);

/// Whether clients built from one schema and servers built from the other understand each other, as
/// far as some calls of each method with values at random show.
[[nodiscard]] bool can_call(Side& client, Side& server, Random& random);

}  // namespace rtpm::schema::test
