#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "rtpm/schema/conform.hpp"

/// Random schemas and edits of them, for testing the compatibility of versions.
namespace rtpm::schema::test {

using Random = std::mt19937;

/// A number from 0 to `count` - 1.
[[nodiscard]] inline std::size_t below(Random& random, std::size_t count) {
  return std::uniform_int_distribution<std::size_t>(0, count - 1)(random);
}

struct FieldText {
  std::string name{};
  std::string type{};
  std::string default_value{};  ///< Empty if none is written.
  bool is_required = false;
  bool is_deprecated = false;
  bool is_key = false;
  std::string unit{};
  std::string frame{};
  std::string range{};
};

struct TypeText {
  std::string kind{};  ///< "enum", "struct", "union", "table".
  std::string name{};
  std::string underlying{};         ///< The underlying type of an enum.
  std::vector<FieldText> fields{};  ///< An enum's values have numbers in default_value.
  std::uint32_t event = 0;
};

struct MethodText {
  std::string name{};
  std::uint32_t id = 0;
  std::string request{};
  std::string reply{};
  bool is_idempotent = false;
  bool is_deferred = false;
  std::uint32_t deadline_us = 0;
  std::uint32_t max_size = 0;
};

struct SchemaText {
  std::string name_space = "lab";
  std::vector<TypeText> types{};  ///< A type may use the types before it.
  std::vector<MethodText> methods{};
  std::uint32_t priority = 0;

  [[nodiscard]] std::string text() const;
  [[nodiscard]] const TypeText* find(const std::string& name) const;
};

/// A schema with every kind of type, all reached from methods.
[[nodiscard]] SchemaText random_schema(Random& random);

/// Applies a random edit to `schema` and describes it; nullopt if it does not fit the schema.
[[nodiscard]] std::optional<ChangeKind> edit(SchemaText& schema, Random& random);

}  // namespace rtpm::schema::test
