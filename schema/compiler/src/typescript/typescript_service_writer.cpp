#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emit/prose.hpp"
#include "model/quantities.hpp"
#include "model/ranged_types.hpp"
#include "model/reach.hpp"
#include "model/spelling.hpp"
#include "model/words.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "typescript/typescript_names.hpp"
#include "typescript/typescript_writer.hpp"

// A service's methods, client and servant, and the checks of ranges.
namespace rtpm::schema::typescript {
namespace {

std::string kind(const Method& method) {
  if (method.is_stream) return "stream";
  if (method.oneway == OnewayLevel::kSent) return "oneway";
  return method.oneway == OnewayLevel::kReceived ? "receipt" : "call";
}

std::string check_statement(const Model& model, const Object& object, const Field& field,
                            const std::string& value) {
  if (!field.range) {
    return check_name(model, referred_name(model, field.type)) + '(' + value + ");\n";
  }
  const std::string low = number_text(field.range->low);
  const std::string high = number_text(field.range->high);
  return "rtpm.scalars.range(" + literal(short_name(object.name) + '.' + field.name) + ", " +
         value + ", " + low + ", " + high + ", " +
         literal(low + " to " + high + (field.unit.empty() ? "" : ' ' + field.unit)) + ");\n";
}

std::string object_check(const Model& model, const RangedTypes& types, const Object& object) {
  std::string text = "\nfunction " + check_name(model, object.name) +
                     "(value: " + type_name(model, object.name) + "): void {\n";
  for (const Field& field : object.fields) {
    if (field.is_deprecated || (!field.range && !types.has(field.type))) continue;
    const std::string value = "value." + member(field.name);
    const bool may_be_absent =
        field.range ? field.is_optional : !object.is_struct && !field.is_required;
    if (field.type.is_many()) {
      text +=
          "  for (const item of " + value + ") " + check_statement(model, object, field, "item");
    } else {
      text += (may_be_absent ? "  if (" + value + " !== undefined) " : "  ") +
              check_statement(model, object, field, value);
    }
  }
  return text + "}\n";
}

std::string union_check(const Model& model, const RangedTypes& types, const Enum& enumeration) {
  std::string text = "\nfunction " + check_name(model, enumeration.name) +
                     "(value: " + type_name(model, enumeration.name) + "): void {\n";
  for (const EnumValue& value : enumeration.values) {
    if (!types.has(value.union_type)) continue;
    text += "  if (value.type === " + literal(value.name) + ") " +
            check_name(model, referred_name(model, value.union_type)) + "(value.value);\n";
  }
  return text + "}\n";
}

std::string method_type(const Model& model, const Method& method) {
  return "rtpm.Method<" + payload_type(model, method.request) + ", " +
         payload_type(model, method.reply) + '>';
}

std::string milliseconds(std::uint32_t time_us) {
  return number_text(static_cast<double>(time_us) / 1000);
}

std::string method_value(const Model& model, const RangedTypes& types, const Method& method) {
  std::string request = payload_codec(model, method.request);
  if (types.has(method.request)) {
    const Payload& payload = method.request;
    request = "rtpm.checked(" + request + ", " +
              check_name(model, model.objects[payload.struct_index.value_or(payload.table)].name) +
              ')';
  }
  std::string text = "  " + member(method.name) + ": {\n    name: " + literal(method.name) +
                     ",\n    id: " + std::to_string(method.id) +
                     ",\n    kind: " + literal(kind(method)) + ",\n    request: " + request +
                     ",\n    reply: " + payload_codec(model, method.reply) +
                     ",\n    fingerprint: " + hexadecimal(method.fingerprint, 8) + ",\n";
  if (method.is_idempotent) text += "    isIdempotent: true,\n";
  if (method.deadline_us) text += "    deadlineMs: " + milliseconds(*method.deadline_us) + ",\n";
  if (method.role != Role::kCommand) {
    text += "    role: " + literal(spelling_of(method.role)) + ",\n";
  }
  if (method.max_size) text += "    maxSize: " + std::to_string(*method.max_size) + ",\n";
  return text + "  },\n";
}

std::string methods_text(const Model& model, const Service& service, const std::string& stem) {
  const RangedTypes types(model);
  std::string heads;
  std::string values;
  for (const Method& method : service.methods) {
    heads += "  readonly " + member(method.name) + ": " + method_type(model, method) + ";\n";
    values += method_value(model, types, method);
  }
  return "\n/** The methods of " + service.name + ". */\nexport const " + stem + "Methods: {\n" +
         heads + "} = {\n" + values + "};\n";
}

std::string interface_value(const Model& model, const Service& service, const std::string& stem,
                            const std::string& compiler_version) {
  std::string methods;
  for (const Method& method : service.methods)
    methods += "    " + stem + "Methods." + member(method.name) + ",\n";
  std::string text =
      "\n/** The interface, to bind or serve an object with it. */\nexport const " + stem +
      "Interface: rtpm.Interface = {\n  name: " + literal(service.name) +
      ",\n  fingerprint: " + hexadecimal(service.fingerprint, 16) + "n,\n  methods: [\n" + methods +
      "  ],\n  priorityModel: " + literal(spelling_of(service.priority_model)) + ",\n";
  if (service.priority) text += "  priority: " + std::to_string(*service.priority) + ",\n";
  return text + "  text: " + template_literal(interface_text(model, service)) +
         ",\n  schema: " + template_literal(schema_text(model, service)) +
         ",\n  compilerVersion: " + literal(compiler_version) + ",\n};\n";
}

std::string service_comment(const Service& service, const std::string& more) {
  Documentation lines = service.documentation;
  emit::add_paragraph(lines, {more});
  if (const std::string facts = priority_facts(service); !facts.empty()) lines.push_back(facts);
  return '\n' + comment(lines, "");
}

std::string client_method(const Model& model, const Method& method, const std::string& stem) {
  const std::string reply = payload_type(model, method.reply);
  const bool is_sent = method.oneway == OnewayLevel::kSent;
  const bool is_empty = method.request.kind == PayloadKind::kEmpty;
  std::vector<std::string> parameters;
  if (!is_empty) parameters.push_back("request: " + payload_type(model, method.request));
  parameters.emplace_back("options?: rtpm.CallOptions");
  const std::string result = method.is_stream ? "AsyncIterable<" + reply + '>'
                             : is_sent        ? "void"
                                              : "Promise<" + reply + '>';
  return '\n' + comment(emit::method_notes(model, method), "  ") + "  " + member(method.name) +
         '(' + emit::joined(parameters, ", ") + "): " + result + " {\n    " +
         (is_sent ? "" : "return ") + "this.#caller." +
         (method.is_stream ? "stream"
          : is_sent        ? "send"
                           : "call") +
         '(' + stem + "Methods." + member(method.name) + ", " +
         (is_empty ? "undefined" : "request") + ", options);\n  }\n";
}

std::string client_text(const Model& model, const Service& service, const std::string& stem) {
  std::string text = service_comment(service, "The client side of " + service.name + '.') +
                     "export class " + stem +
                     "Client {\n  readonly #caller: rtpm.Caller;\n\n  /** @param caller bound to "
                     "the object with " +
                     stem +
                     "Interface */\n  constructor(caller: rtpm.Caller) {\n    this.#caller = "
                     "caller;\n  }\n";
  for (const Method& method : service.methods)
    text += client_method(model, method, stem);
  return text + "}\n";
}

std::string operation(const Method& method, const std::string& stem) {
  const bool is_empty = method.request.kind == PayloadKind::kEmpty;
  const std::string head = "    rtpm.operation(" + stem + "Methods." + member(method.name) + ", (" +
                           (is_empty ? "_" : "") + "request, context) =>";
  const std::string call =
      "servant." + member(method.name) + (is_empty ? "(context)" : "(request, context)");
  if (head.size() + call.size() + 3 <= emit::kColumnMax) return head + ' ' + call + "),\n";
  return head + "\n      " + call + ",\n    ),\n";
}

std::string servant_text(const Model& model, const Service& service, const std::string& stem) {
  std::string heads;
  std::string operations;
  for (const Method& method : service.methods) {
    const std::string reply = payload_type(model, method.reply);
    const std::string result =
        method.is_stream ? "AsyncIterable<" + reply + '>' : reply + " | Promise<" + reply + '>';
    const bool is_empty = method.request.kind == PayloadKind::kEmpty;
    heads += comment(emit::method_notes(model, method), "  ") + "  " + member(method.name) + '(' +
             (is_empty ? "" : "request: " + payload_type(model, method.request) + ", ") +
             "context: rtpm.CallContext): " + result + ";\n";
    operations += operation(method, stem);
  }
  return service_comment(service, "The server side of " + service.name +
                                      ": write its methods. A request was checked against the "
                                      "schema.") +
         "export interface " + stem + "Servant {\n" + heads +
         "}\n\n/** The object to serve for a servant. */\nexport function " +
         skeleton_name(model, service.name) + "(servant: " + stem +
         "Servant): rtpm.Skeleton {\n  return rtpm.skeleton(" + stem + "Interface, [\n" +
         operations + "  ]);\n}\n";
}

}  // namespace

std::string checks_text(const Model& model) {
  const RangedTypes types(model);
  Reach reach;
  for (const Service& service : model.services) {
    for (const Method& method : service.methods) {
      if (method.request.kind == PayloadKind::kEmpty) continue;
      reach.add(model, method.request.struct_index.value_or(method.request.table));
    }
  }
  std::string text;
  for (const std::size_t index : reach.objects) {
    if (types.has_object(index)) text += object_check(model, types, model.objects[index]);
  }
  for (const std::size_t index : reach.enums) {
    if (types.has_union(index)) text += union_check(model, types, model.enums[index]);
  }
  return text;
}

std::string service_text(const Model& model, const Service& service,
                         const std::string& compiler_version) {
  const std::string stem = type_name(model, service.name);
  return methods_text(model, service, stem) +
         interface_value(model, service, stem, compiler_version) +
         client_text(model, service, stem) + servant_text(model, service, stem);
}

}  // namespace rtpm::schema::typescript
