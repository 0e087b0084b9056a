#include <cstddef>
#include <string>

#include "cpp/cpp_names.hpp"
#include "cpp/cpp_ranges.hpp"
#include "cpp/cpp_writer.hpp"
#include "model/verify_limits.hpp"
#include "model/words.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace rtpm::schema::cpp {
namespace {

std::string status(const std::string& name) {
  return "{::rtpm::wire::Status::" + name + ", 0}";
}

/// The members for the priority in a service's descriptor.
std::string priority(const Service& service) {
  if (!service.priority) return {};
  return ",\n    .priority_model = ::rtpm::rpc::PriorityModel::" +
         std::string(service.priority_model == PriorityModel::kServerDeclared
                         ? "kServerDeclared"
                         : "kClientPropagated") +
         ",\n    .priority = " + std::to_string(*service.priority);
}

/// The member for the role in a method's descriptor; empty for kCommand, the default.
std::string role(const Method& method) {
  switch (method.role) {
    case Role::kObserve:
      return ",\n     .role = ::rtpm::Role::kObserve";
    case Role::kCommand:
      return {};
    case Role::kConfigure:
      return ",\n     .role = ::rtpm::Role::kConfigure";
    case Role::kAdminister:
      break;
  }
  return ",\n     .role = ::rtpm::Role::kAdminister";
}

std::string descriptors(const Model& model, const Service& service,
                        const std::string& compiler_version) {
  const std::string stem = short_name(service.name);
  std::string text =
      "namespace {\n\nconstexpr ::rtpm::rpc::MethodDescriptor k" + stem + "Methods[] = {\n";
  for (const Method& method : service.methods) {
    text += "    {.id = " + std::to_string(method.id) + ",\n     .name = " + literal(method.name) +
            ",\n     .fingerprint = " + hexadecimal(method.fingerprint, 8) +
            ",\n     .is_idempotent = " + (method.is_idempotent ? "true" : "false") +
            ",\n     .default_deadline = ::std::chrono::microseconds{" +
            std::to_string(method.deadline_us.value_or(0)) + "}" + role(method) + "},\n";
  }
  text += "};\n\nconstexpr ::rtpm::rpc::InterfaceDescriptor k" + stem +
          "Interface{\n    .name = " + literal(service.name) +
          ",\n    .fingerprint = " + hexadecimal(service.fingerprint, 16) +
          ",\n    .compiler_version = " + literal(compiler_version) + ",\n    .methods = k" + stem +
          "Methods" + priority(service) +
          ",\n    .schema = " + raw_literal(schema_text(model, service)) +
          ",\n    .text = " + raw_literal(interface_text(model, service)) +
          "};\n\n}  // namespace\n";
  return text;
}

/// The limits of a table's verification, as the last argument.
std::string limits(const Model& model, const Payload& payload) {
  const VerifyLimits limits = verify_limits(model, payload.table);
  return ",\n          ::rtpm::rpc::TableLimits{.depth = " + std::to_string(limits.depth) +
         ", .tables = " + std::to_string(limits.tables) + '}';
}

/// The runtime call that sends `request` and returns the method's kind of reply.
std::string call(const Model& model, const Service& service, std::size_t index,
                 const std::string& request) {
  const Method& method = service.methods[index];
  const std::string arguments = "rtpm_binding_, k" + short_name(service.name) + "Methods[" +
                                std::to_string(index) + "], " + request;
  const bool is_table = method.reply.kind == PayloadKind::kTable;
  if (method.oneway && *method.oneway != OnewayLevel::kDone) {
    const bool is_sent = *method.oneway == OnewayLevel::kSent;
    return "  return ::rtpm::rpc::send_oneway(\n      " + arguments +
           ", ::rtpm::wire::Delivery::" + (is_sent ? "kSent" : "kReceipt") + ", options);\n";
  }
  if (method.is_stream) {
    return "  return ::rtpm::rpc::open_stream_of<" + stream_type(model, method) + ">(\n      " +
           arguments + ", options" + (is_table ? limits(model, method.reply) : "") + ");\n";
  }
  std::string function = "nothing";
  if (method.reply.kind == PayloadKind::kStruct) {
    function = "struct<" + payload_type(model, method.reply) + '>';
  } else if (method.reply.kind == PayloadKind::kTable) {
    function = "table<" + payload_type(model, method.reply) + '>';
  }
  return "  return ::rtpm::rpc::call_for_" + function + "(\n      " + arguments + ", options" +
         (is_table ? limits(model, method.reply) : "") + ");\n";
}

/// Packs `request` on the heap.
std::string packing(const std::string& type) {
  return "  ::flatbuffers::FlatBufferBuilder builder;\n  builder.Finish(" + type +
         "::Pack(builder, &request));\n";
}

/// Refuses a request larger than the schema allows.
std::string size_check(const Method& method) {
  if (!method.max_size || method.request.kind != PayloadKind::kTable) return {};
  return "  if (request.size() > " + std::to_string(*method.max_size) +
         ") {\n    return ::rtpm::unexpected{::rtpm::rpc::CallError::kTooLarge};\n  }\n";
}

/// The definitions of the begin_…() overloads.
std::string begin_methods(const Model& model, const Service& service, std::size_t index,
                          Function head, const std::string& request) {
  const Method& method = service.methods[index];
  if (!can_begin(method)) return {};
  const std::string class_name = short_name(service.name) + "Client::";
  head.result = begin_result(model, method);
  head.name = class_name + begin_name(method);
  head.tail = " {";
  std::string text;
  if (method.request.kind == PayloadKind::kTable) {
    const std::string type = payload_type(model, method.request);
    Function packed = head;
    packed.parameters.front() = "const " + type + "T& request";
    text = '\n' + function(packed, "") + packing(type) + "  return this->" + begin_name(method) +
           "_encoded(::rtpm::rpc::table_bytes(builder), options);\n}\n";
    head.name += "_encoded";
  }
  const bool is_table = method.reply.kind == PayloadKind::kTable;
  return text + '\n' + function(head, "") + size_check(method) +
         "  return ::rtpm::rpc::begin_call<" + reply_handle(model, method, "Pending") +
         ">(\n      rtpm_binding_, k" + short_name(service.name) + "Methods[" +
         std::to_string(index) + "], " + request + ", options" +
         (is_table ? limits(model, method.reply) : "") + ");\n}\n";
}

/// The definition of a client's method.
/// @param request  an expression for the method's parameter
std::string sending_method(const Model& model, const Service& service, std::size_t index,
                           Function head, const std::string& request) {
  const Method& method = service.methods[index];
  head.tail = method.is_stream ? " {" : " noexcept {";
  return '\n' + function(head, "") + size_check(method) + call(model, service, index, request) +
         "}\n" + begin_methods(model, service, index, head, request);
}

std::string client_method(const Model& model, const Service& service, std::size_t index) {
  const Method& method = service.methods[index];
  const std::string type = payload_type(model, method.request);
  Function head{
      .lead = "",
      .result = client_result(model, method),
      .name = short_name(service.name) + "Client::" + method_name(service, method),
      .parameters = {"const " + type + "& request",
                     std::string("const ::rtpm::rpc::") +
                         (method.is_stream ? "StreamOptions" : "CallOptions") + "& options"},
      .tail = " {"};
  switch (method.request.kind) {
    case PayloadKind::kEmpty:
      head.parameters.front() = "const " + type + "& /*request*/";
      return sending_method(model, service, index, head, "{}");
    case PayloadKind::kStruct:
      return sending_method(model, service, index, head, "::rtpm::rpc::struct_bytes(request)");
    case PayloadKind::kTable:
      break;
  }
  Function encoded = head;
  encoded.name += "_encoded";
  encoded.parameters.front() = "::rtpm::ConstBytes request";
  head.parameters.front() = "const " + type + "T& request";
  return '\n' + function(head, "") + packing(type) + "  return this->" +
         method_name(service, method) +
         "_encoded(::rtpm::rpc::table_bytes(builder), options);\n}\n" +
         sending_method(model, service, index, encoded, "request");
}

std::string client(const Model& model, const Service& service) {
  const std::string stem = short_name(service.name);
  const std::string name = stem + "Client";
  std::string text = "\nconst ::rtpm::rpc::InterfaceDescriptor& " + name +
                     "::interface() noexcept {\n  return k" + stem +
                     "Interface;\n}\n\n"
                     "::rtpm::expected<" +
                     name + ", ::rtpm::SetupError> " + name +
                     "::bind(\n"
                     "    ::rtpm::rpc::Node& node, ::std::string_view target, const "
                     "::rtpm::rpc::BindOptions& options) {\n"
                     "  auto binding = ::rtpm::rpc::Binding::bind(node, target, k" +
                     stem +
                     "Interface, options);\n"
                     "  if (!binding) return ::rtpm::unexpected{::std::move(binding.error())};\n"
                     "  return " +
                     name + "{::std::move(*binding)};\n}\n";
  for (std::size_t i = 0; i < service.methods.size(); ++i)
    text += client_method(model, service, i);
  return text;
}

/// The type of a request in words, with an article.
std::string request_in_words(const Model& model, const Method& method) {
  switch (method.request.kind) {
    case PayloadKind::kEmpty:
      break;
    case PayloadKind::kStruct: {
      const Object& type = model.objects[*method.request.struct_index];
      return "a " + type.name + " of " + std::to_string(type.byte_size) + " bytes";
    }
    case PayloadKind::kTable:
      return "a " + model.objects[method.request.table].name;
  }
  return "empty";
}

/// Validates a request before any of it is read.
std::string request_check(const Model& model, const Method& method) {
  std::string wrong = "!request.empty()";
  if (method.request.kind == PayloadKind::kStruct) {
    wrong = "request.size() != sizeof(" + payload_type(model, method.request) + ')';
  } else if (method.request.kind == PayloadKind::kTable) {
    wrong = "!::rtpm::rpc::is_valid_table<" + payload_type(model, method.request) + ">(request" +
            limits(model, method.request) + ')';
  }
  std::string text;
  if (method.max_size && method.request.kind == PayloadKind::kTable) {
    text = "      if (request.size() > " + std::to_string(*method.max_size) +
           ") {\n        return " + status("kTooLarge") + ";\n      }\n";
  }
  return text + "      if (" + wrong + ") {\n        return ::rtpm::rpc::refuse_request(\"" +
         request_in_words(model, method) + "\", request, reply);\n      }\n";
}

/// Defines `argument`, if the method takes one, and checks its ranges.
std::string argument(const Model& model, const Ranges& ranges, const Method& method) {
  const std::string type = payload_type(model, method.request);
  const std::string lead = "      const auto& argument = ";
  const std::string range_check = ranges.are_in(method.request)
                                      ? "      ::rtpm::rpc::RangeCheck check;\n"
                                        "      if (!rtpm_in_range(argument, check)) {\n"
                                        "        return check.refuse(reply);\n      }\n"
                                      : "";
  switch (method.request.kind) {
    case PayloadKind::kEmpty:
      return "";
    case PayloadKind::kStruct:
      return lead + "::rtpm::rpc::view_struct<" + type + ">(request);\n" + range_check;
    case PayloadKind::kTable:
      break;
  }
  return lead + "*::flatbuffers::GetRoot<" + type + ">(request.data());\n" + range_check;
}

std::string reply_memory(const Method& method) {
  if (!method.max_size) return "reply";
  return "::rtpm::rpc::at_most(reply, " + std::to_string(*method.max_size) + ')';
}

/// The maximum size of a deferred table, as the last argument.
std::string deferred_size(const Method& method) {
  if (!method.max_size || method.reply.kind != PayloadKind::kTable) return {};
  return ", " + std::to_string(*method.max_size) + 'u';
}

std::string dispatch_case(const Model& model, const Ranges& ranges, const Service& service,
                          const Method& method) {
  const std::string name = method_name(service, method);
  const std::string call =
      "this->" + name + (method.request.kind == PayloadKind::kEmpty ? "(" : "(argument, ");
  const std::string text = "    case " + short_name(service.name) + "MethodId::" + name + ": {\n" +
                           request_check(model, method) + argument(model, ranges, method);
  if (method.is_stream || method.is_deferred) {
    return text + "      return ::rtpm::rpc::run_deferred<" + deferred_type(model, method) +
           ">(\n          ::rtpm::rpc::" + (method.is_stream ? "open_stream" : "defer") +
           "(context), [&](auto deferred) { " + call + "::std::move(deferred), context); }" +
           deferred_size(method) + ");\n    }\n";
  }
  switch (method.reply.kind) {
    case PayloadKind::kEmpty:
      return text + "      return ::rtpm::rpc::reply_with_nothing(" + call + "context));\n    }\n";
    case PayloadKind::kStruct:
      return text + "      return ::rtpm::rpc::reply_with_struct(" + call +
             "context), reply);\n    }\n";
    case PayloadKind::kTable:
      break;
  }
  return text + "      ::rtpm::rpc::ReplyBuilder<" + payload_type(model, method.reply) +
         "> builder{" + reply_memory(method) + "};\n      const auto result = " + call +
         "builder, context);\n" +
         "      if (!result) return {::rtpm::rpc::to_status(result.error()), 0};\n"
         "      return builder.complete();\n    }\n";
}

std::string servant(const Model& model, const Ranges& ranges, const Service& service) {
  const std::string stem = short_name(service.name);
  std::string text =
      "\nconst ::rtpm::rpc::InterfaceDescriptor& " + stem +
      "Servant::interface() const noexcept {\n  return k" + stem +
      "Interface;\n}\n\n"
      "::rtpm::rpc::DispatchResult " +
      stem +
      "Servant::dispatch(\n"
      "    ::std::uint16_t method_id, ::rtpm::ConstBytes request, " +
      (service.methods.empty() ? "::rtpm::MutableBytes /*reply*/" : "::rtpm::MutableBytes reply") +
      ",\n    const ::rtpm::rpc::CallContext& context) {\n"
      "  switch (static_cast<" +
      stem + "MethodId>(method_id)) {\n";
  for (const Method& method : service.methods)
    text += dispatch_case(model, ranges, service, method);
  return text + "  }\n  return " + status("kNoSuchMethod") + ";\n}\n";
}

}  // namespace

std::string source(const Model& model, const std::string& compiler_version) {
  std::string text =
      banner(model, compiler_version) + "#include " + literal(model.file_stem + ".rtpm.hpp") + '\n';
  if (model.services.empty()) return text;
  const Ranges ranges(model);
  text += "\n#include <chrono>\n" + ranges.functions();
  for (const Service& service : model.services) {
    const std::string scope = namespace_name(namespace_of(service.name));
    text += '\n';
    if (!scope.empty()) text += "namespace " + scope + " {\n";
    text += descriptors(model, service, compiler_version) + client(model, service) +
            servant(model, ranges, service);
    if (!scope.empty()) text += "\n}  // namespace " + scope + '\n';
  }
  return text;
}

}  // namespace rtpm::schema::cpp
