#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "cpp/cpp_names.hpp"
#include "cpp/cpp_writer.hpp"
#include "model/event_fields.hpp"
#include "model/quantities.hpp"
#include "model/verify_limits.hpp"
#include "model/words.hpp"
#include "reading/reflection.hpp"
#include "rtpm/schema/schema_text.hpp"

// Events have their own header, so that only code that uses events links rtpm::events.
namespace rtpm::schema::cpp {
namespace {

const char* scalar_type(BaseType base) noexcept {
  constexpr std::array<const char*, 13> kNames{nullptr,   nullptr,   "kBool",  "kInt8",   "kUint8",
                                               "kInt16",  "kUint16", "kInt32", "kUint32", "kInt64",
                                               "kUint64", "kFloat",  "kDouble"};
  return kNames[static_cast<std::size_t>(base)];
}

std::string default_of(const Field& field) {
  if (field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble) {
    const std::string limits = "::std::numeric_limits<double>::";
    if (std::isnan(field.default_real)) return limits + "quiet_NaN()";
    if (std::isinf(field.default_real)) {
      return (field.default_real < 0 ? "-" : "") + limits + "infinity()";
    }
    return "double{" + number_text(field.default_real) + '}';
  }
  if (is_unsigned(field.type.base)) {
    return "::std::uint64_t{" + std::to_string(static_cast<std::uint64_t>(field.default_integer)) +
           "u}";
  }
  // C++ has no literal for the smallest integer.
  if (field.default_integer == std::numeric_limits<std::int64_t>::min()) {
    return "::std::numeric_limits<::std::int64_t>::min()";
  }
  return "::std::int64_t{" + std::to_string(field.default_integer) + '}';
}

std::string field_descriptor(const EventField& field) {
  std::string text = "{.name = " + literal(field.name) +
                     ",\n       .type = ::rtpm::events::ScalarType::" + scalar_type(field.type) +
                     ",\n       .path = {";
  if (!field.slots.empty()) {
    text += ".slots = {";
    for (std::size_t i = 0; i < field.slots.size(); ++i)
      text += (i > 0 ? ", " : "") + std::to_string(field.slots[i]);
    text += "}, .slot_count = " + std::to_string(field.slots.size()) + ", ";
  }
  text += ".offset = " + std::to_string(field.offset) + "}";
  if (!field.slots.empty()) {
    text +=
        ",\n       .default_value = ::rtpm::events::Scalar::of(" + default_of(*field.field) + ')';
  }
  return text + '}';
}

std::string event(const Model& model, std::size_t index) {
  const Object& object = model.objects[index];
  const Payload payload = payload_of(model, index);
  const std::string type = payload_type(model, payload);
  const EventNames names = event_names(object.name);
  const std::string name(short_name(names.descriptor));
  const std::vector<EventField> numbers = event_fields(model, payload);
  const VerifyLimits limits = verify_limits(model, index);
  Documentation lines = object.documentation;
  for (std::string& line : quantities(model, payload, "payload"))
    lines.push_back(std::move(line));
  lines.push_back("Event " + std::to_string(*object.event_id) + ", " + object.name +
                  "; its payload is " +
                  (payload.kind == PayloadKind::kStruct ? "the bare struct." : "a FlatBuffer."));
  std::string text = comment(lines, "") + "struct " + name + " {\n";
  text += "  using Payload = " + type + ";\n";
  text += "  static constexpr bool kIsStruct = " +
          std::string(payload.kind == PayloadKind::kStruct ? "true" : "false") + ";\n";
  text +=
      "  static constexpr ::rtpm::events::EventType kType = " + std::to_string(*object.event_id) +
      ";\n";
  text += "  static constexpr ::std::uint64_t kSchemaId = " +
          hexadecimal(object.event_fingerprint, 16) + ";\n";
  text +=
      "  /// Bounds of a payload's verification.\n"
      "  static constexpr ::rtpm::rpc::TableLimits kLimits{.depth = " +
      std::to_string(limits.depth) + ", .tables = " + std::to_string(limits.tables) + "};\n";
  if (!numbers.empty()) {
    text +=
        "  /// The numbers that filters can read.\n"
        "  static constexpr ::rtpm::events::FieldDescriptor kFields[] = {\n";
    for (const EventField& number : numbers)
      text += "      " + field_descriptor(number) + ",\n";
    text += "  };\n";
  }
  return text +
         "  static constexpr ::rtpm::events::EventDescriptor kDescriptor{\n      .type = kType, "
         ".name = " +
         literal(object.name) + ", .schema_id = kSchemaId" +
         (numbers.empty() ? "" : ", .fields = kFields") +
         ",\n      .schema = " + raw_literal(schema_text(model, object)) + "};\n};\n\n/// Pushes " +
         object.name + ".\nusing " + short_name(names.supplier) +
         " = ::rtpm::events::TypedSupplier<" + name + ">;\n/// Gets " + object.name + ".\nusing " +
         short_name(names.consumer) + " = ::rtpm::events::TypedConsumer<" + name + ">;\n";
}

}  // namespace

std::string events_header(const Model& model, const std::string& compiler_version) {
  std::string text = banner(model, compiler_version) + "#pragma once\n\n";
  std::string events;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const Object& object = model.objects[i];
    if (!object.event_id || object.declaration_file != model.declaration_file) continue;
    const std::string scope = namespace_name(namespace_of(object.name));
    events += '\n';
    if (!scope.empty()) events += "namespace " + scope + " {\n\n";
    events += event(model, i);
    if (!scope.empty()) events += "\n}  // namespace " + scope + '\n';
  }
  if (events.empty()) return text + "// The schema has no events.\n";
  return text + "#include <cstdint>\n#include <limits>\n\n#include " +
         literal(model.file_stem + "_generated.h") + "\n#include \"rtpm/events/typed.hpp\"\n" +
         events;
}

}  // namespace rtpm::schema::cpp
