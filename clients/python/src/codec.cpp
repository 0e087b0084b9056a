#include "codec.hpp"

#include <flatbuffers/flatbuffers.h>
#include <nanobind/stl/string.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

#include "errors.hpp"
#include "waiting.hpp"

namespace nb = nanobind;

namespace rtpm::python {
namespace {

using schema::BaseType;
using schema::Field;
using schema::Model;
using schema::Object;
using schema::PayloadKind;
using Builder = flatbuffers::FlatBufferBuilder;
using Offset = flatbuffers::Offset<void>;

/// The nesting of tables that every receiver accepts.
constexpr std::size_t kDepthMax = 32;

constexpr const char* kTypeNames[]{"none",  "union",  "bool",  "int8",   "uint8", "int16", "uint16",
                                   "int32", "uint32", "int64", "uint64", "float", "double"};

flatbuffers::voffset_t slot_of(const Field& field) noexcept {
  return static_cast<flatbuffers::voffset_t>(4 + 2 * field.id);
}

/// Calls `function` with a value of the number's C++ type.
template <class Function>
auto with_number(BaseType type, const Function& function) {
  switch (type) {
    case BaseType::kBool:
    case BaseType::kUint8:
    case BaseType::kUnionType:
      return function(std::uint8_t{});
    case BaseType::kInt8:
      return function(std::int8_t{});
    case BaseType::kInt16:
      return function(std::int16_t{});
    case BaseType::kUint16:
      return function(std::uint16_t{});
    case BaseType::kInt32:
      return function(std::int32_t{});
    case BaseType::kUint32:
      return function(std::uint32_t{});
    case BaseType::kInt64:
      return function(std::int64_t{});
    case BaseType::kUint64:
      return function(std::uint64_t{});
    case BaseType::kFloat:
      return function(float{});
    default:
      return function(double{});
  }
}

std::string text_of(nb::handle object) {
  return nb::cast<std::string>(nb::str(object));
}

[[noreturn]] void refuse(const std::string& field, const std::string& takes, nb::handle value) {
  raise_type_error(
      field + " takes " + takes + ", not " +
      text_of(nb::handle(reinterpret_cast<PyObject*>(Py_TYPE(value.ptr()))).attr("__name__")));
}

/// A Python number as T.
template <class T>
T number_from(nb::handle value, BaseType type, const std::string& field) {
  const auto takes = [&] { return std::string(kTypeNames[static_cast<std::size_t>(type)]); };
  if constexpr (std::is_floating_point_v<T>) {
    const double number = PyFloat_AsDouble(value.ptr());
    if (number != -1.0 || PyErr_Occurred() == nullptr) return static_cast<T>(number);
    PyErr_Clear();
    refuse(field, "a number", value);
  } else {
    const nb::object index = nb::steal(PyNumber_Index(value.ptr()));
    if (!index.is_valid()) {
      PyErr_Clear();
      refuse(field, type == BaseType::kBool ? "a bool" : "an integer", value);
    }
    using Wide = std::conditional_t<std::is_signed_v<T>, long long, unsigned long long>;
    Wide wide{};
    if constexpr (std::is_signed_v<T>) {
      wide = PyLong_AsLongLong(index.ptr());
    } else {
      wide = PyLong_AsUnsignedLongLong(index.ptr());
    }
    const bool is_outside = PyErr_Occurred() != nullptr ||
                            wide > static_cast<Wide>(std::numeric_limits<T>::max()) ||
                            wide < static_cast<Wide>(std::numeric_limits<T>::min()) ||
                            (type == BaseType::kBool && wide > Wide{1});
    PyErr_Clear();
    if (is_outside) raise_value_error(field + " takes " + takes() + ", not " + text_of(index));
    return static_cast<T>(wide);
  }
}

const std::uint8_t* follow(const std::uint8_t* offset) noexcept {
  return offset + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(offset);
}

/// Writes one message.
class Writer {
 public:
  Writer(const Model& model, const nb::list& objects) : model_(model), objects_(objects) {}

  std::vector<std::byte> write(std::size_t object, nb::handle value) {
    builder_.Finish(flatbuffers::Offset<flatbuffers::Table>(table(object, value).o));
    const auto bytes = std::as_bytes(std::span(builder_.GetBufferPointer(), builder_.GetSize()));
    return {bytes.begin(), bytes.end()};
  }

 private:
  /// The value of a field before its table: its offset, or a number's or struct's object.
  struct Part {
    const Field* field;
    nb::object value;
    Offset offset{};
    std::uint8_t union_type = 0;
    Offset union_types{};  ///< The types of a vector of unions.
  };

  nb::handle class_of(std::size_t object) const { return objects_[object][0]; }

  void check_class(std::size_t object, nb::handle value, const std::string& field) const {
    const int is_one = PyObject_IsInstance(value.ptr(), class_of(object).ptr());
    if (is_one < 0) raise_python_error();
    if (is_one == 0) refuse(field, "a " + text_of(class_of(object).attr("__name__")), value);
  }

  Offset table(std::size_t object, nb::handle value) {
    const Object& type = model_.objects[object];
    const std::string name = schema::short_name(type.name);
    check_class(object, value, name);
    // A table that contains itself has no end.
    if (++depth_ > kDepthMax) raise_value_error(name + " is nested too deeply");
    std::vector<Part> parts;
    for (const Field& field : type.fields) {
      const nb::object attribute = objects_[object][1][field.id];
      if (attribute.is_none()) continue;
      Part part{&field, value.attr(attribute)};
      const std::string path = name + "." + field.name;
      if (part.value.is_none()) {
        if (field.is_required) raise_value_error(path + " is required");
        continue;
      }
      const bool is_written =
          field.type.base <= BaseType::kDouble || is_struct(field) || put(part, path);
      if (is_written) parts.push_back(std::move(part));
    }
    --depth_;
    return finish(name, parts);
  }

  bool is_struct(const Field& field) const {
    return field.type.base == BaseType::kObject && model_.objects[*field.type.index].is_struct;
  }

  /// Writes what stands outside the table. False if there is nothing to write.
  bool put(Part& part, const std::string& path) {
    const Field& field = *part.field;
    switch (field.type.base) {
      case BaseType::kString:
        part.offset = string(part.value, path);
        return field.is_required || nb::len(part.value) > 0;
      case BaseType::kVector:
        if (!field.is_required && nb::len(part.value) == 0) return false;
        part.offset = vector(part, path);
        return true;
      case BaseType::kUnion:
        part.offset = member(*field.type.index, part.value, path, part.union_type);
        return true;
      default:
        part.offset = table(*field.type.index, part.value);
        return true;
    }
  }

  Offset string(nb::handle value, const std::string& path) {
    if (!PyUnicode_Check(value.ptr())) refuse(path, "a str", value);
    Py_ssize_t size = 0;
    const char* text = PyUnicode_AsUTF8AndSize(value.ptr(), &size);
    if (text == nullptr) raise_python_error();
    return builder_.CreateString(text, static_cast<std::size_t>(size)).o;
  }

  /// A union's value, and the number of its type.
  Offset member(std::size_t index, nb::handle value, const std::string& path,
                std::uint8_t& union_type) {
    const schema::Enum& type = model_.enums[index];
    std::string names;
    for (const schema::EnumValue& candidate : type.values) {
      union_type = static_cast<std::uint8_t>(candidate.value);
      if (candidate.union_type.base == BaseType::kString && PyUnicode_Check(value.ptr())) {
        return string(value, path);
      }
      if (candidate.union_type.base != BaseType::kObject) continue;
      const std::size_t object = *candidate.union_type.index;
      if (PyObject_IsInstance(value.ptr(), class_of(object).ptr()) == 1) {
        return model_.objects[object].is_struct ? bare(object, value) : table(object, value);
      }
      names += (names.empty() ? "" : " or ") + text_of(class_of(object).attr("__name__"));
    }
    refuse(path, "a " + names, value);
  }

  /// A struct that stands outside a table.
  Offset bare(std::size_t object, nb::handle value) {
    const nb::bytes bytes(value);
    builder_.Align(model_.objects[object].alignment);
    builder_.PushBytes(static_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    return builder_.GetSize();
  }

  Offset vector(Part& part, const std::string& path) {
    const Field& field = *part.field;
    const schema::Type& type = field.type;
    if (type.element <= BaseType::kDouble && type.element != BaseType::kUnionType) {
      return numbers(type.element, part.value, path);
    }
    if (type.has_object() && model_.objects[*type.index].is_struct) {
      const Object& object = model_.objects[*type.index];
      return packed(helper("struct_bytes")(class_of(*type.index), part.value, path),
                    object.byte_size, object.alignment);
    }
    std::vector<Offset> offsets;
    std::vector<std::uint8_t> types;
    std::size_t number = 0;
    for (const nb::handle item : nb::iter(part.value)) {
      const std::string at = path + "[" + std::to_string(number++) + "]";
      if (type.element == BaseType::kString) {
        offsets.push_back(string(item, at));
      } else if (type.element == BaseType::kUnion) {
        offsets.push_back(member(*type.index, item, at, types.emplace_back()));
      } else {
        check_class(*type.index, item, at);
        offsets.push_back(table(*type.index, item));
      }
    }
    if (type.element == BaseType::kUnion) part.union_types = builder_.CreateVector(types).o;
    return builder_.CreateVector(offsets).o;
  }

  Offset numbers(BaseType element, nb::handle value, const std::string& path) {
    const nb::object bytes =
        helper("number_bytes")(kTypeNames[static_cast<std::size_t>(element)], value, path);
    return packed(bytes, size_of(element), size_of(element));
  }

  Offset packed(const nb::object& object, std::size_t element_size, std::size_t alignment) {
    const nb::bytes bytes(object);
    // Elements may be structs, so their alignment is the unit.
#if FLATBUFFERS_VERSION_MAJOR >= 23
    builder_.StartVector(bytes.size() / alignment, alignment, alignment);
#else
    builder_.StartVector(bytes.size() / alignment, alignment);
#endif
    builder_.PushBytes(static_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    return builder_.EndVector(bytes.size() / element_size);
  }

  static nb::object helper(const char* name) {
    return nb::module_::import_("rtpm.values").attr(name);
  }

  Offset finish(const std::string& name, const std::vector<Part>& parts) {
    const auto start = builder_.StartTable();
    for (const Part& part : parts) {
      const Field& field = *part.field;
      const auto slot = slot_of(field);
      const auto type_slot = static_cast<flatbuffers::voffset_t>(slot - 2);
      if (field.type.base <= BaseType::kDouble) {
        number(field, part.value, name + "." + field.name);
      } else if (is_struct(field)) {
        check_class(*field.type.index, part.value, name + "." + field.name);
        builder_.AddStructOffset(slot, bare(*field.type.index, part.value).o);
      } else {
        builder_.AddOffset(slot, part.offset);
        if (field.type.base == BaseType::kUnion) {
          builder_.AddElement<std::uint8_t>(type_slot, part.union_type, 0);
        } else if (field.type.element == BaseType::kUnion) {
          builder_.AddOffset(type_slot, part.union_types);
        }
      }
    }
    return builder_.EndTable(start);
  }

  void number(const Field& field, nb::handle value, const std::string& path) {
    with_number(field.type.base, [&](auto zero) {
      using T = decltype(zero);
      const T given = number_from<T>(value, field.type.base, path);
      if (field.is_optional) {
        builder_.AddElement<T>(slot_of(field), given);
      } else if constexpr (std::is_floating_point_v<T>) {
        builder_.AddElement<T>(slot_of(field), given, static_cast<T>(field.default_real));
      } else {
        builder_.AddElement<T>(slot_of(field), given, static_cast<T>(field.default_integer));
      }
    });
  }

  const Model& model_;
  const nb::list& objects_;
  Builder builder_{};
  std::size_t depth_ = 0;
};

/// Reads a verified message.
class Reader {
 public:
  Reader(const Model& model, const nb::list& objects, const nb::list& enums)
      : model_(model), objects_(objects), enums_(enums) {}

  nb::object table(std::size_t object, const std::uint8_t* data) const {
    const auto* table = static_cast<const flatbuffers::Table*>(static_cast<const void*>(data));
    const nb::object type = objects_[object][0];
    nb::object result = type.attr("__new__")(type);
    for (const Field& field : model_.objects[object].fields) {
      const nb::object attribute = objects_[object][1][field.id];
      if (!attribute.is_none()) nb::setattr(result, attribute, value(*table, field));
    }
    return result;
  }

 private:
  nb::object value(const flatbuffers::Table& table, const Field& field) const {
    const std::uint8_t* at = table.GetAddressOf(slot_of(field));
    const schema::Type& type = field.type;
    if (type.base <= BaseType::kDouble) {
      if (at == nullptr && field.is_optional) return nb::none();
      return number(type, at, field);
    }
    if (type.base == BaseType::kString) return at == nullptr ? nb::str("") : string(follow(at));
    if (type.base == BaseType::kVector) return vector(table, field, at);
    if (at == nullptr) return nb::none();
    if (type.base == BaseType::kObject) return object(*type.index, at);
    const auto slot = static_cast<flatbuffers::voffset_t>(slot_of(field) - 2);
    return member(*type.index, table.GetField<std::uint8_t>(slot, 0), follow(at));
  }

  nb::object object(std::size_t index, const std::uint8_t* at) const {
    return model_.objects[index].is_struct ? structure(index, at) : table(index, follow(at));
  }

  nb::object structure(std::size_t index, const std::uint8_t* at) const {
    return objects_[index][0].attr("from_buffer_copy")(
        nb::bytes(at, model_.objects[index].byte_size));
  }

  nb::object member(std::size_t index, std::uint8_t type, const std::uint8_t* at) const {
    for (const schema::EnumValue& candidate : model_.enums[index].values) {
      if (candidate.value != type) continue;
      if (candidate.union_type.base == BaseType::kString) return string(at);
      if (candidate.union_type.base != BaseType::kObject) break;
      const std::size_t object = *candidate.union_type.index;
      return model_.objects[object].is_struct ? structure(object, at) : table(object, at);
    }
    return nb::none();
  }

  nb::object number(const schema::Type& type, const std::uint8_t* at, const Field& field) const {
    const nb::object plain = with_number(type.base, [&](auto zero) -> nb::object {
      using T = decltype(zero);
      T result = at == nullptr ? T{} : flatbuffers::ReadScalar<T>(at);
      if constexpr (std::is_floating_point_v<T>) {
        if (at == nullptr) result = static_cast<T>(field.default_real);
        return nb::float_(static_cast<double>(result));
      } else {
        if (at == nullptr) result = static_cast<T>(field.default_integer);
        if (type.base == BaseType::kBool) return nb::bool_(result != 0);
        return nb::int_(result);
      }
    });
    return type.index ? enums_[*type.index](plain) : plain;
  }

  static nb::object string(const std::uint8_t* at) {
    const auto* text = static_cast<const flatbuffers::String*>(static_cast<const void*>(at));
    // Other languages may send text that is no UTF-8.
    PyObject* decoded = PyUnicode_DecodeUTF8(text->c_str(), static_cast<Py_ssize_t>(text->size()),
                                             "backslashreplace");
    if (decoded == nullptr) raise_python_error();
    return nb::steal(decoded);
  }

  nb::object vector(const flatbuffers::Table& table, const Field& field,
                    const std::uint8_t* at) const {
    const schema::Type& type = field.type;
    const auto* data = at == nullptr ? nullptr : follow(at);
    const std::size_t count =
        data == nullptr ? 0 : flatbuffers::ReadScalar<flatbuffers::uoffset_t>(data);
    if (data != nullptr) data += sizeof(flatbuffers::uoffset_t);
    if (type.element <= BaseType::kDouble && type.element != BaseType::kUnionType) {
      return numbers(type, data, count);
    }
    if (type.has_object() && model_.objects[*type.index].is_struct) {
      const nb::object kind = objects_[*type.index][0];
      // The class times a number: `Force * 3` is the class of an array.
      const nb::object array = nb::steal(PyNumber_Multiply(kind.ptr(), nb::int_(count).ptr()));
      return array.attr("from_buffer_copy")(
          nb::bytes(data, count * model_.objects[*type.index].byte_size));
    }
    const auto slot = static_cast<flatbuffers::voffset_t>(slot_of(field) - 2);
    const auto* types = type.element == BaseType::kUnion
                            ? table.GetPointer<const flatbuffers::Vector<std::uint8_t>*>(slot)
                            : nullptr;
    nb::list items;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint8_t* item = follow(data + i * sizeof(flatbuffers::uoffset_t));
      if (type.element == BaseType::kString) {
        items.append(string(item));
      } else if (types != nullptr) {
        items.append(member(*type.index, types->Get(static_cast<flatbuffers::uoffset_t>(i)), item));
      } else {
        items.append(this->table(*type.index, item));
      }
    }
    return items;
  }

  nb::object numbers(const schema::Type& type, const std::uint8_t* data, std::size_t count) const {
    const nb::bytes bytes(data, count * size_of(type.element));
    if (!type.index && (type.element == BaseType::kUint8 || type.element == BaseType::kInt8)) {
      return bytes;
    }
    const nb::object numbers =
        nb::module_::import_("rtpm.values")
            .attr("numbers_from")(kTypeNames[static_cast<std::size_t>(type.element)], bytes);
    if (!type.index) return numbers;
    nb::list items;
    for (const nb::handle number : nb::iter(numbers))
      items.append(enums_[*type.index](number));
    return items;
  }

  const Model& model_;
  const nb::list& objects_;
  const nb::list& enums_;
};

}  // namespace

Codec::Codec(const std::string& schema) {
  std::string error;
  dynamic_ = schema::Dynamic::make(schema, error);
  if (!dynamic_) raise_value_error("the schema can't be read: " + error);
}

void Codec::set_classes(nb::list objects, nb::list enums) {
  objects_ = std::move(objects);
  enums_ = std::move(enums);
}

nb::object Codec::class_of(std::size_t object) const {
  return objects_[object][0];
}

nb::object Codec::struct_from(std::size_t object, ConstBytes bytes) const {
  return class_of(object).attr("from_buffer_copy")(nb::bytes(bytes.data(), bytes.size()));
}

std::vector<std::byte> Codec::encode(const schema::Payload& payload, nb::handle value) const {
  if (payload.kind == PayloadKind::kEmpty) return {};
  if (payload.kind == PayloadKind::kTable) {
    const RunsPython scope;
    return Writer(model(), objects_).write(payload.table, value);
  }
  const nb::object type = class_of(*payload.struct_index);
  if (PyObject_IsInstance(value.ptr(), type.ptr()) != 1) {
    refuse("the argument", "a " + text_of(type.attr("__name__")), value);
  }
  const nb::bytes bytes(value);
  const auto* data = static_cast<const std::byte*>(bytes.data());
  return {data, data + bytes.size()};
}

nb::object Codec::decode(const schema::Payload& payload, ConstBytes bytes) const {
  if (payload.kind == PayloadKind::kEmpty && bytes.empty()) return nb::none();
  if (payload.kind == PayloadKind::kStruct &&
      bytes.size() == model().objects[*payload.struct_index].byte_size) {
    return struct_from(*payload.struct_index, bytes);
  }
  if (payload.kind == PayloadKind::kTable) {
    const auto table = dynamic_->as_table(payload, bytes);
    if (table) {
      const RunsPython scope;
      const auto* data = static_cast<const std::uint8_t*>(static_cast<const void*>(table->data()));
      return Reader(model(), objects_, enums_).table(payload.table, follow(data));
    }
  }
  raise(rpc::CallError::kBadReply, {}, {});
}

std::string Codec::refusal(const schema::Payload& payload, ConstBytes bytes) const {
  return dynamic_->refusal(payload, bytes);
}

}  // namespace rtpm::python
