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
#include "model/quantities.hpp"
#include "model/verify_limits.hpp"
#include "model/words.hpp"
#include "reading/reflection.hpp"
#include "rtpm/schema/schema_text.hpp"

// Events have their own header, so that only code that uses events links rtpm::events.
namespace rtpm::schema::cpp {
namespace {

// How deep a hub reads payloads, and how many fields it reads per event.
constexpr std::size_t kSlotCountMax = 4;
constexpr std::size_t kFieldCountMax = 256;

const char* scalar_type(BaseType base) noexcept {
  constexpr std::array<const char*, 13> kNames{nullptr,   nullptr,   "kBool",  "kInt8",   "kUint8",
                                               "kInt16",  "kUint16", "kInt32", "kUint32", "kInt64",
                                               "kUint64", "kFloat",  "kDouble"};
  const auto index = static_cast<std::size_t>(base);
  return index < kNames.size() ? kNames[index] : nullptr;
}

/// The scalars of an event's payload, outside arrays, vectors and unions, with their paths.
class Numbers {
 public:
  explicit Numbers(const Model& model) : model_(model) {}

  std::vector<std::string> of(const Payload& payload) {
    const std::size_t index = payload.struct_index.value_or(payload.table);
    if (model_.objects[index].is_struct) {
      add_struct(index, "", {}, 0);
    } else {
      add_table(index, "", {});
    }
    return std::move(lines_);
  }

 private:
  using Slots = std::vector<std::uint16_t>;

  void add_struct(std::size_t index, const std::string& lead, const Slots& slots,
                  std::size_t offset) {
    for (const Field& field : model_.objects[index].fields) {
      const std::size_t at = offset + field.offset;
      if (field.type.base == BaseType::kObject) {
        add_struct(*field.type.index, lead + field.name + '.', slots, at);
      } else {
        add(field, lead, slots, at);
      }
    }
  }

  void add_table(std::size_t index, const std::string& lead, const Slots& above) {
    if (above.size() == kSlotCountMax) return;
    for (const Field& field : model_.objects[index].fields) {
      if (field.is_deprecated) continue;
      Slots slots = above;
      slots.push_back(field.id);
      if (field.type.base != BaseType::kObject) {
        add(field, lead, slots, 0);
      } else if (model_.objects[*field.type.index].is_struct) {
        add_struct(*field.type.index, lead + field.name + '.', slots, 0);
      } else {
        add_table(*field.type.index, lead + field.name + '.', slots);
      }
    }
  }

  void add(const Field& field, const std::string& lead, const Slots& slots, std::size_t offset) {
    const char* const type = scalar_type(field.type.base);
    if (type == nullptr || lines_.size() == kFieldCountMax) return;
    std::string text = "{.name = " + literal(lead + field.name) +
                       ",\n       .type = ::rtpm::events::ScalarType::" + type +
                       ",\n       .path = {";
    if (!slots.empty()) {
      text += ".slots = {";
      for (std::size_t i = 0; i < slots.size(); ++i)
        text += (i > 0 ? ", " : "") + std::to_string(slots[i]);
      text += "}, .slot_count = " + std::to_string(slots.size()) + ", ";
    }
    text += ".offset = " + std::to_string(offset) + "}";
    if (!slots.empty()) {
      text += ",\n       .default_value = ::rtpm::events::Scalar::of(" + default_of(field) + ')';
    }
    lines_.push_back(text + '}');
  }

  static std::string default_of(const Field& field) {
    if (field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble) {
      const std::string limits = "::std::numeric_limits<double>::";
      if (std::isnan(field.default_real)) return limits + "quiet_NaN()";
      if (std::isinf(field.default_real)) {
        return (field.default_real < 0 ? "-" : "") + limits + "infinity()";
      }
      return "double{" + number_text(field.default_real) + '}';
    }
    const bool is_unsigned =
        field.type.base == BaseType::kBool || field.type.base == BaseType::kUint8 ||
        field.type.base == BaseType::kUint16 || field.type.base == BaseType::kUint32 ||
        field.type.base == BaseType::kUint64;
    if (is_unsigned) {
      return "::std::uint64_t{" +
             std::to_string(static_cast<std::uint64_t>(field.default_integer)) + "u}";
    }
    // C++ has no literal for the smallest integer.
    if (field.default_integer == std::numeric_limits<std::int64_t>::min()) {
      return "::std::numeric_limits<::std::int64_t>::min()";
    }
    return "::std::int64_t{" + std::to_string(field.default_integer) + '}';
  }

  const Model& model_;
  std::vector<std::string> lines_{};
};

std::string event(const Model& model, std::size_t index) {
  const Object& object = model.objects[index];
  const Payload payload = payload_of(model, index);
  const std::string type = payload_type(model, payload);
  const EventNames names = event_names(object.name);
  const std::string name(short_name(names.descriptor));
  const std::vector<std::string> numbers = Numbers(model).of(payload);
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
    for (const std::string& number : numbers)
      text += "      " + number + ",\n";
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
