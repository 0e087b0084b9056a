#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::viewers {

/// A message as JSON, by the reflection of its type.
inline nlohmann::json decoded(Type type, const Message& message) {
  const Schema schema = schema_of(type);
  const auto compiled = schema::compile_binary(
      {static_cast<const std::uint8_t*>(static_cast<const void*>(schema.reflection.data())),
       schema.reflection.size()},
      std::string(schema.name));
  EXPECT_TRUE(compiled.model) << schema::render(compiled.errors);
  if (!compiled.model) return {};
  std::string error;
  const auto dynamic = schema::Dynamic::make(schema::schema_text(*compiled.model), error);
  EXPECT_TRUE(dynamic) << error;
  if (!dynamic) return {};
  for (std::size_t i = 0; i < dynamic->model().objects.size(); ++i) {
    if (dynamic->model().objects[i].name != schema.name) continue;
    const auto text = dynamic->decode(schema::payload_of(dynamic->model(), i), message);
    EXPECT_TRUE(text) << schema.name;
    if (text) return nlohmann::json::parse(*text);
  }
  ADD_FAILURE() << schema.name << " is not in its schema";
  return {};
}

}  // namespace rtpm::viewers
