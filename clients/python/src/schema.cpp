#include "schema.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdint>

#include "errors.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "rtpm/schema/python_names.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

using schema::BaseType;
using schema::Model;

std::string documentation(const schema::Documentation& lines) {
  std::string text;
  for (const std::string& line : lines) {
    const std::size_t begin = line.starts_with(' ') ? 1 : 0;
    text += line.substr(begin) + '\n';
  }
  return text;
}

nb::object range_of(const schema::Field& field) {
  if (!field.range) return nb::none();
  return nb::make_tuple(field.range->low, field.range->high);
}

nb::object default_of(const schema::Field& field) {
  if (field.is_optional || field.type.base > BaseType::kDouble) return nb::none();
  if (field.type.base >= BaseType::kFloat) return nb::float_(field.default_real);
  if (field.type.base == BaseType::kBool) return nb::bool_(field.default_integer != 0);
  if (field.type.base == BaseType::kUint64) {
    return nb::int_(static_cast<std::uint64_t>(field.default_integer));
  }
  return nb::int_(field.default_integer);
}

nb::dict field_layout(const schema::Field& field) {
  nb::dict layout;
  layout["name"] = field.name;
  layout["attribute"] = schema::python_name(field.name);
  layout["is_hidden"] = !schema::is_in_python(field);
  layout["base"] = static_cast<int>(field.type.base);
  layout["element"] = static_cast<int>(field.type.element);
  layout["index"] = field.type.index ? nb::object(nb::int_(*field.type.index)) : nb::none();
  layout["length"] = field.type.fixed_length;
  layout["id"] = field.id;
  layout["offset"] = field.offset;
  layout["default"] = default_of(field);
  layout["is_required"] = field.is_required;
  layout["is_optional"] = field.is_optional;
  layout["unit"] = field.unit;
  layout["frame"] = field.frame;
  layout["range"] = range_of(field);
  layout["doc"] = documentation(field.documentation);
  return layout;
}

nb::dict object_layout(const Model& model, const schema::Object& object) {
  nb::list fields;
  for (const schema::Field& field : object.fields)
    fields.append(field_layout(field));
  nb::dict layout;
  layout["name"] = object.name;
  layout["class"] = schema::python_type_name(model, object.name);
  layout["is_hidden"] = !schema::is_in_python(object);
  layout["is_struct"] = object.is_struct;
  layout["size"] = object.byte_size;
  layout["event"] = object.event_id ? nb::object(nb::int_(*object.event_id)) : nb::none();
  layout["fingerprint"] = object.event_fingerprint;
  layout["fields"] = fields;
  layout["doc"] = documentation(object.documentation);
  return layout;
}

nb::dict enum_layout(const Model& model, const schema::Enum& type) {
  nb::list values;
  for (const schema::EnumValue& value : type.values) {
    const auto& of = value.union_type;
    values.append(nb::make_tuple(schema::python_name(value.name), value.value,
                                 static_cast<int>(of.base),
                                 of.index ? nb::object(nb::int_(*of.index)) : nb::none(),
                                 documentation(value.documentation)));
  }
  nb::dict layout;
  layout["name"] = type.name;
  layout["class"] = schema::python_type_name(model, type.name);
  layout["is_union"] = type.is_union;
  layout["is_bit_flags"] = type.is_bit_flags;
  layout["base"] = static_cast<int>(type.underlying);
  layout["values"] = values;
  layout["doc"] = documentation(type.documentation);
  return layout;
}

nb::object payload_layout(const schema::Payload& payload) {
  if (payload.kind == schema::PayloadKind::kEmpty) return nb::none();
  return nb::int_(payload.struct_index.value_or(payload.table));
}

nb::dict service_layout(const Model& model, const schema::Service& service) {
  nb::list methods;
  for (const schema::Method& method : service.methods) {
    nb::dict layout;
    layout["name"] = method.name;
    layout["attribute"] = schema::python_name(method.name);
    layout["request"] = payload_layout(method.request);
    layout["reply"] = payload_layout(method.reply);
    layout["is_stream"] = method.is_stream;
    layout["is_oneway"] = method.oneway.has_value();
    layout["is_idempotent"] = method.is_idempotent;
    layout["deadline"] =
        method.deadline_us ? nb::object(nb::float_(*method.deadline_us * 1e-6)) : nb::none();
    layout["doc"] = documentation(method.documentation);
    methods.append(layout);
  }
  nb::dict layout;
  layout["name"] = service.name;
  layout["class"] = schema::python_type_name(model, service.name);
  layout["fingerprint"] = service.fingerprint;
  layout["methods"] = methods;
  layout["doc"] = documentation(service.documentation);
  return layout;
}

}  // namespace

Schema::Schema(const std::string& text) : text_(text), codec_(text) {
  const Model& model = codec_.model();
  interfaces_.resize(model.services.size());
  for (std::size_t i = 0; i < model.services.size(); ++i) {
    const schema::Service& service = model.services[i];
    Interface& interface = interfaces_[i];
    for (const schema::Method& method : service.methods) {
      interface.methods.push_back(
          {.id = method.id,
           .name = method.name,
           .fingerprint = method.fingerprint,
           .is_idempotent = method.is_idempotent,
           .default_deadline = std::chrono::microseconds{method.deadline_us.value_or(0)},
           .role = static_cast<Role>(method.role)});
    }
    interface.text = schema::interface_text(model, service);
    interface.schema = schema::schema_text(model, service);
    interface.descriptor = {
        .name = service.name,
        .fingerprint = service.fingerprint,
        .compiler_version = RTPM_VERSION,
        .methods = interface.methods,
        .priority_model = static_cast<rpc::PriorityModel>(service.priority_model),
        .priority = Priority{service.priority.value_or(0)},
        .schema = interface.schema,
        .text = interface.text};
  }
}

nb::dict Schema::layout() const {
  nb::list objects;
  nb::list enums;
  nb::list services;
  for (const schema::Object& object : codec_.model().objects)
    objects.append(object_layout(codec_.model(), object));
  for (const schema::Enum& type : codec_.model().enums)
    enums.append(enum_layout(codec_.model(), type));
  for (const schema::Service& service : codec_.model().services)
    services.append(service_layout(codec_.model(), service));
  nb::dict layout;
  layout["objects"] = objects;
  layout["enums"] = enums;
  layout["services"] = services;
  return layout;
}

void define_schema(nb::module_& module) {
  nb::class_<Schema>(module, "Schema")
      .def(nb::init<const std::string&>(), "text"_a)
      .def("layout", &Schema::layout)
      .def("set_classes",
           [](Schema& self, nb::list objects, nb::list enums) {
             self.codec().set_classes(std::move(objects), std::move(enums));
           })
      .def("encode",
           [](const Schema& self, std::size_t object, nb::handle value) {
             const auto bytes =
                 self.codec().encode(schema::payload_of(self.codec().model(), object), value);
             return nb::bytes(bytes.data(), bytes.size());
           })
      .def("decode", [](const Schema& self, std::size_t object, const nb::bytes& bytes) {
        return self.codec().decode(
            schema::payload_of(self.codec().model(), object),
            ConstBytes(static_cast<const std::byte*>(bytes.data()), bytes.size()));
      });
}

}  // namespace rtpm::python
