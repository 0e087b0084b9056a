#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/source.hpp"

/// What a schema says, free of FlatBuffers and of any language that code is generated in. Back ends
/// read nothing else. All members are plain values; indices refer to the vectors of the same Model.
namespace rtpm::schema {

using Documentation = std::vector<std::string>;  ///< The lines of the `///` comment, as written.

struct Attribute {
  std::string name{};
  std::string value{};  ///< "0" for an attribute without a value: so FlatBuffers has it.
};

/// The kinds of a field's type; FlatBuffers' own, numbered as in its reflection.
enum class BaseType : std::uint8_t {
  kNone,
  kUnionType,
  kBool,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat,
  kDouble,
  kString,
  kVector,
  kObject,
  kUnion,
  kArray,
};

/// A type, in a field or as a union's alternative.
struct Type {
  BaseType base = BaseType::kNone;
  BaseType element = BaseType::kNone;  ///< Of a vector or array.
  /// Of an object (table or struct) in Model::objects, else of an enumeration in Model::enums.
  std::optional<std::size_t> index{};
  std::uint16_t fixed_length = 0;  ///< Elements of an array.
};

/// From the lowest to the highest value, both included.
struct Range {
  double low = 0;
  double high = 0;
};

struct Field {
  std::string name{};
  Type type{};
  std::uint16_t id = 0;      ///< In tables: the slot. In structs: the position.
  std::uint16_t offset = 0;  ///< In structs: bytes from the begin.
  std::int64_t default_integer = 0;
  double default_real = 0;
  bool is_required = false;
  bool is_optional = false;
  bool is_deprecated = false;
  bool is_key = false;
  std::string unit{};            ///< `rtpm_unit`; empty: not stated.
  std::string frame{};           ///< `rtpm_frame`; empty: not stated.
  std::optional<Range> range{};  ///< `rtpm_range`.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  Location location{};  ///< Its name. As all places: line 0 if the model came from a .bfbs.
};

/// A table or a struct.
struct Object {
  std::string name{};  ///< Fully qualified, with dots.
  bool is_struct = false;
  std::size_t alignment = 1;                ///< Bytes.
  std::size_t byte_size = 0;                ///< Of a struct.
  std::vector<Field> fields{};              ///< By id.
  std::optional<std::uint32_t> event_id{};  ///< `rtpm_event`, of a table that is an event.
  std::uint64_t event_fingerprint = 0;      ///< Of an event.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  std::string declaration_file{};  ///< Absolute, links resolved.
  Location location{};             ///< Its name.
};

struct EnumValue {
  std::string name{};
  std::int64_t value = 0;
  Type union_type{};
  Documentation documentation{};
  Location location{};
};

/// An enumeration or a union.
struct Enum {
  std::string name{};  ///< Fully qualified, with dots.
  bool is_union = false;
  BaseType underlying = BaseType::kNone;
  std::vector<EnumValue> values{};  ///< By value.
  Documentation documentation{};
  std::string declaration_file{};
  Location location{};  ///< Its name.
};

/// How a request or reply stands on the wire.
enum class PayloadKind : std::uint8_t {
  kEmpty,   ///< `rtpm.Empty`: no bytes.
  kStruct,  ///< A table whose only field is one required struct: the bare struct.
  kTable,   ///< Any other table: a finished FlatBuffer.
};

/// A method's request or reply.
struct Payload {
  PayloadKind kind = PayloadKind::kEmpty;
  std::size_t table = 0;                      ///< In Model::objects.
  std::optional<std::size_t> struct_index{};  ///< In Model::objects, of kStruct.
};

/// How far a oneway request must have come until the caller goes on.
enum class OnewayLevel : std::uint8_t {
  kSent,      ///< "sent": handed to the caller's own system; it may not arrive.
  kReceived,  ///< "received": the server has it.
  kDone,      ///< "done": the servant's method has returned.
};

/// Who decides at which priority a service's methods run.
enum class PriorityModel : std::uint8_t {
  kClientPropagated,  ///< The caller, and the service's priority where the caller states none.
  kServerDeclared,    ///< Always the service's priority.
};

struct Method {
  std::string name{};
  std::uint16_t id = 0;  ///< `rtpm_id`, 1…65535.
  Payload request{};
  Payload reply{};
  bool is_idempotent = false;                  ///< `rtpm_idempotent`.
  std::optional<std::uint32_t> deadline_us{};  ///< `rtpm_deadline_us`.
  std::optional<OnewayLevel> oneway{};         ///< `rtpm_oneway`; the reply is then kEmpty.
  bool is_deferred = false;                    ///< `rtpm_deferred`.
  bool is_stream = false;                   ///< `rtpm_stream`: any number of replies, each an item.
  std::optional<std::uint32_t> max_size{};  ///< `rtpm_max_size`: bytes of a request or reply.
  std::uint32_t fingerprint = 0;
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  Location location{};
};

struct Service {
  std::string name{};  ///< Fully qualified, with dots.
  std::uint64_t fingerprint = 0;
  std::vector<Method> methods{};                                    ///< As declared.
  PriorityModel priority_model = PriorityModel::kClientPropagated;  ///< `rtpm_priority_model`.
  std::optional<std::uint16_t> priority{};                          ///< `rtpm_priority`.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  Location location{};
};

/// One name of the `namespace` statements of the compiled file, such as `lab` of `lab.arms`.
struct NamespaceName {
  std::string name{};
  Location location{};
};

/// A compiled schema file.
struct Model {
  std::string file{};       ///< As the person named it.
  std::string file_stem{};  ///< "haptic" of "dir/haptic.fbs".
  std::string
      declaration_file{};         ///< Absolute, links resolved: what Object::declaration_file says.
  std::vector<Object> objects{};  ///< Tables and structs, included files' too.
  std::vector<Enum> enums{};      ///< Enumerations and unions, included files' too.
  std::vector<Service> services{};  ///< Only the ones that the file itself declares, as declared.
  std::vector<NamespaceName> namespaces{};
  std::uint64_t feature_bits = 0;  ///< FlatBuffers' `advanced_features`.
  /// The file and all that it includes, as they were found: what output depends on.
  std::vector<std::string> source_files{};
};

/// "Arm" of "lab.Arm".
[[nodiscard]] std::string short_name(const std::string& qualified_name);
/// "lab" of "lab.Arm", empty for a name of the global namespace.
[[nodiscard]] std::string namespace_of(const std::string& qualified_name);

}  // namespace rtpm::schema
