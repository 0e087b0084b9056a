#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rtpm/schema/source.hpp"

/// A schema's content, independent of FlatBuffers and of target languages; the only input of back
/// ends. Plain values; indices refer to the vectors of the same Model.
namespace rtpm::schema {

using Documentation = std::vector<std::string>;  ///< The lines of the `///` comment, as written.

struct Attribute {
  std::string name{};
  std::string value{};  ///< "0" for an attribute without a value, as in FlatBuffers.
};

/// Numbered as in FlatBuffers' reflection.
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

/// The size of a number or boolean, in bytes.
[[nodiscard]] constexpr std::size_t size_of(BaseType type) noexcept {
  switch (type) {
    case BaseType::kInt16:
    case BaseType::kUint16:
      return 2;
    case BaseType::kInt32:
    case BaseType::kUint32:
    case BaseType::kFloat:
      return 4;
    case BaseType::kInt64:
    case BaseType::kUint64:
    case BaseType::kDouble:
      return 8;
    default:
      return 1;
  }
}

/// The type of a field or of a union's member.
struct Type {
  BaseType base = BaseType::kNone;
  BaseType element = BaseType::kNone;  ///< The element type of a vector or array.
  /// Index in Model::objects for a table or struct, otherwise in Model::enums.
  std::optional<std::size_t> index{};
  std::uint16_t fixed_length = 0;  ///< The number of elements of an array.

  [[nodiscard]] bool is_many() const noexcept {
    return base == BaseType::kVector || base == BaseType::kArray;
  }
  /// The element type of a vector or array; for other types, the type itself.
  [[nodiscard]] BaseType innermost() const noexcept { return is_many() ? element : base; }
  [[nodiscard]] bool has_object() const noexcept { return innermost() == BaseType::kObject; }
};

/// A closed range.
struct Range {
  double low = 0;
  double high = 0;
};

struct Field {
  std::string name{};
  Type type{};
  std::uint16_t id = 0;      ///< In tables, the slot; in structs, the position.
  std::uint16_t offset = 0;  ///< In structs, bytes from the start.
  std::int64_t default_integer = 0;
  double default_real = 0;
  bool is_required = false;
  bool is_optional = false;
  bool is_deprecated = false;
  bool is_key = false;
  std::string unit{};            ///< `rtpm_unit`; empty if not stated.
  std::string frame{};           ///< `rtpm_frame`; empty if not stated.
  std::optional<Range> range{};  ///< `rtpm_range`.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  /// Where the name is declared. In a model from a .bfbs all locations have line 0.
  Location location{};
};

/// A table or a struct.
struct Object {
  std::string name{};  ///< Fully qualified, with dots.
  bool is_struct = false;
  std::size_t alignment = 1;                ///< In bytes.
  std::size_t byte_size = 0;                ///< The size of a struct.
  std::vector<Field> fields{};              ///< Ordered by id.
  std::optional<std::uint32_t> event_id{};  ///< `rtpm_event`, if the table is an event.
  std::uint64_t event_fingerprint = 0;      ///< The fingerprint of an event.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  std::string declaration_file{};  ///< Absolute, with links resolved.
  Location location{};             ///< Where the name is declared.
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
  bool is_bit_flags = false;  ///< `bit_flags`: a value may be a sum of the values here.
  BaseType underlying = BaseType::kNone;
  std::vector<EnumValue> values{};  ///< Ordered by value.
  Documentation documentation{};
  std::string declaration_file{};
  Location location{};  ///< Where the name is declared.
};

/// The encoding of a request or reply.
enum class PayloadKind : std::uint8_t {
  kEmpty,   ///< `rtpm.Empty`: no bytes.
  kStruct,  ///< A table whose only field is one required struct: the bare struct.
  kTable,   ///< Any other table: a finished FlatBuffer.
};

/// A method's request or reply.
struct Payload {
  PayloadKind kind = PayloadKind::kEmpty;
  std::size_t table = 0;                      ///< Index in Model::objects.
  std::optional<std::size_t> struct_index{};  ///< Index in Model::objects of a kStruct.
};

/// How far a oneway must have progressed before its caller continues.
enum class OnewayLevel : std::uint8_t {
  kSent,      ///< "sent": the caller's system has the request; it may get lost.
  kReceived,  ///< "received": the server has the request.
  kDone,      ///< "done": the servant's method has returned.
};

/// The role that a caller needs; each role includes the previous ones.
enum class Role : std::uint8_t {
  kObserve,     ///< "observe"
  kCommand,     ///< "command"
  kConfigure,   ///< "configure"
  kAdminister,  ///< "administer"
};

/// At which priority a service's methods run.
enum class PriorityModel : std::uint8_t {
  kClientPropagated,  ///< The caller's priority; the service's if the caller states none.
  kServerDeclared,    ///< The service's priority.
};

struct Method {
  std::string name{};
  std::uint16_t id = 0;  ///< `rtpm_id`, 1…65535.
  Payload request{};
  Payload reply{};
  bool is_idempotent = false;                  ///< `rtpm_idempotent`.
  std::optional<std::uint32_t> deadline_us{};  ///< `rtpm_deadline_us`.
  std::optional<OnewayLevel> oneway{};         ///< `rtpm_oneway`; the reply is then kEmpty.
  Role role = Role::kCommand;                  ///< `rtpm_role`.
  bool is_deferred = false;                    ///< `rtpm_deferred`.
  bool is_stream = false;  ///< `rtpm_stream`: any number of replies, each an item.
  /// `rtpm_max_size`: the limit of a request or reply in bytes.
  std::optional<std::uint32_t> max_size{};
  std::uint32_t fingerprint = 0;
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  Location location{};
};

struct Service {
  std::string name{};  ///< Fully qualified, with dots.
  std::uint64_t fingerprint = 0;
  std::vector<Method> methods{};  ///< In the order of declaration.
  PriorityModel priority_model = PriorityModel::kClientPropagated;  ///< `rtpm_priority_model`.
  std::optional<std::uint16_t> priority{};                          ///< `rtpm_priority`.
  std::vector<Attribute> attributes{};
  Documentation documentation{};
  Location location{};
};

/// One component of a `namespace` statement in the compiled file, such as `lab` in `lab.arms`.
struct NamespaceName {
  std::string name{};
  Location location{};
};

/// A compiled schema file.
struct Model {
  std::string file{};       ///< As given on the command line.
  std::string file_stem{};  ///< Such as "haptic" for "dir/haptic.fbs".
  /// The file, as in Object::declaration_file: absolute, with links resolved.
  std::string declaration_file{};
  std::vector<Object> objects{};    ///< Tables and structs, including those of included files.
  std::vector<Enum> enums{};        ///< Enumerations and unions, including those of included files.
  std::vector<Service> services{};  ///< Services that the file itself declares, in order.
  std::vector<NamespaceName> namespaces{};
  std::uint64_t feature_bits = 0;  ///< FlatBuffers' `advanced_features`.
  /// The file and its included files, with the paths where they were found.
  std::vector<std::string> source_files{};
  /// For each file that includes others, by declaration_file: all of them. Empty in a model from a
  /// .bfbs.
  std::map<std::string, std::set<std::string>> included_files{};
};

/// The last component of a name: "Arm" for "lab.Arm".
[[nodiscard]] std::string short_name(const std::string& qualified_name);
/// The namespace of a name: "lab" for "lab.Arm"; empty for the global namespace.
[[nodiscard]] std::string namespace_of(const std::string& qualified_name);
/// How the table `table` of `model` is encoded as a payload.
[[nodiscard]] Payload payload_of(const Model& model, std::size_t table);
/// The name of the object or enumeration that `type` refers to; empty if it refers to none.
[[nodiscard]] std::string referred_name(const Model& model, const Type& type);

}  // namespace rtpm::schema
