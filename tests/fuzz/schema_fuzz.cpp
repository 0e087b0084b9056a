// A schema and a payload of another program: any text is a schema or refused, any bytes are a
// payload of it or refused, and a printed payload is read again as the same.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "rtpm/base/assert.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/dynamic.hpp"

using namespace rtpm;

namespace {

void convert(schema::Dynamic& dynamic, const schema::Payload& payload,
             std::span<const std::byte> bytes) {
  static_cast<void>(dynamic.as_table(payload, bytes));
  static_cast<void>(dynamic.from_table(payload, bytes));
  const auto json = dynamic.decode(payload, bytes);
  std::string error;
  static_cast<void>(dynamic.encode(payload, json.value_or("{}"), error));
}

void read_payloads(const std::string& text, const schema::Model& model,
                   std::span<const std::byte> bytes) {
  std::string error;
  for (const schema::Service& service : model.services) {
    const auto dynamic = schema::Dynamic::make(text, service.name, error);
    RTPM_ASSERT(dynamic != nullptr, "what compiles can be used");
    for (const schema::Method& method : dynamic->service().methods) {
      convert(*dynamic, method.request, bytes);
      convert(*dynamic, method.reply, bytes);
      RTPM_ASSERT(!dynamic->reflection_of(method.reply).empty(), "a type has a reflection");
    }
  }
  for (const schema::Object& object : model.objects) {
    if (!object.event_id) continue;
    const auto dynamic = schema::Dynamic::make_for_event(text, object.name, error);
    RTPM_ASSERT(dynamic != nullptr, "what compiles can be used");
    convert(*dynamic, dynamic->event(), bytes);
  }
}

}  // namespace

/// The text ends at the first zero byte; the payload is behind it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as text
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  const std::size_t end = std::min(input.find('\0'), size);
  const std::string text(input.substr(0, end));
  const schema::CompileResult result = schema::compile_text(text, "schema");
  RTPM_ASSERT(result.model.has_value() == result.errors.empty(), "a model or errors");
  if (!result.model) {
    RTPM_ASSERT(!schema::render(result.errors).empty(), "they can be shown");
    return 0;
  }
  read_payloads(text, *result.model,
                std::as_bytes(std::span(data, size).subspan(std::min(end + 1, size))));
  return 0;
}
