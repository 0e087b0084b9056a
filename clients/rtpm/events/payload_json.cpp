#include "events/payload_json.hpp"

#include <string>

#include "rtpm/base/nesting.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::tool {
namespace {

Json json_of_scalar(const events::Scalar& scalar) {
  switch (scalar.kind) {
    case events::Scalar::Kind::kSigned:
      return scalar.integer;
    case events::Scalar::Kind::kUnsigned:
      return scalar.natural;
    case events::Scalar::Kind::kReal:
      break;
  }
  return scalar.real;
}

std::string hex(ConstBytes bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    const auto value = std::to_integer<unsigned>(byte);
    text += kDigits[value >> 4];
    text += kDigits[value & 15];
  }
  return text;
}

Json numbers_of(ConstBytes payload, const events::EventDescriptor& type) {
  Json fields = Json::object();
  for (const events::FieldDescriptor& field : type.fields) {
    const auto value = events::read_scalar(payload, field.path, field.type, field.default_value);
    if (!value) continue;
    const bool is_bool = field.type == events::ScalarType::kBool;
    fields[std::string(field.name)] =
        is_bool ? Json(value->as_real() != 0) : json_of_scalar(*value);
  }
  return fields;
}

}  // namespace

Json payload_json(capture::EventSchemas& schemas, ConstBytes payload,
                  const events::EventDescriptor* type) {
  if (schema::Dynamic* const dynamic = schemas.find(type)) {
    if (const auto text = dynamic->decode(dynamic->event(), payload)) {
      Json json = parse_bounded_json<Json>(*text);
      if (!json.is_discarded()) return json;
    }
  }
  if (type != nullptr) return numbers_of(payload, *type);
  return {{"payload", hex(payload)}};
}

}  // namespace rtpm::tool
