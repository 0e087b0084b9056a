#include <filesystem>
#include <set>
#include <string>
#include <utility>

#include "cpp/cpp_names.hpp"
#include "cpp/cpp_writer.hpp"
#include "model/quantities.hpp"
#include "model/spelling.hpp"

namespace rtpm::schema::cpp {
namespace {

constexpr const char* kOptions = "const ::rtpm::rpc::CallOptions& options = {}";
constexpr const char* kStreamOptions = "const ::rtpm::rpc::StreamOptions& options = {}";

/// The includes of flatc's headers for the data types that the services use.
std::string data_includes(const Model& model) {
  std::set<std::string> stems;
  const auto add = [&](std::size_t index) {
    stems.insert(std::filesystem::path(model.objects[index].declaration_file).stem().string());
  };
  for (const Object& object : model.objects) {
    // flatc only writes types for a file that declares some.
    if (object.declaration_file == model.declaration_file) stems.insert(model.file_stem);
  }
  for (const Enum& enumeration : model.enums) {
    if (enumeration.declaration_file == model.declaration_file) stems.insert(model.file_stem);
  }
  for (const Service& service : model.services) {
    for (const Method& method : service.methods) {
      for (const Payload* payload : {&method.request, &method.reply}) {
        if (payload->kind != PayloadKind::kEmpty) add(payload->table);
        if (payload->struct_index) add(*payload->struct_index);
      }
    }
  }
  std::string text;
  for (const std::string& stem : stems)
    text += "#include " + literal(stem + "_generated.h") + '\n';
  return text;
}

std::string facts(const Method& method) {
  std::string text = "Method " + std::to_string(method.id);
  if (method.is_idempotent) text += ", idempotent";
  if (method.deadline_us) {
    text += ", default deadline " + std::to_string(*method.deadline_us) + " us";
  }
  if (method.oneway) text += ", oneway: its caller " + waiting_of(*method.oneway);
  if (method.role != Role::kCommand) text += ", role " + std::string(spelling_of(method.role));
  if (method.is_deferred) text += ", deferred reply";
  if (method.is_stream) text += ", stream of replies";
  if (method.max_size) {
    text += ", request and reply of at most " + std::to_string(*method.max_size) + " bytes";
  }
  return text + '.';
}

/// A method's comment, with units and ranges, and its attributes.
Documentation documentation_of(const Model& model, const Method& method) {
  Documentation lines = method.documentation;
  for (const auto& [payload, role] :
       {std::pair{&method.request, "request"}, {&method.reply, "reply"}}) {
    for (std::string& line : quantities(model, *payload, role))
      lines.push_back(std::move(line));
  }
  lines.push_back(facts(method));
  return lines;
}

std::string real_time(const Method& method) {
  return method.is_stream ? "@realtime opening allocates, taking items does not"
                          : "@realtime alloc-free once a channel of the priority's band is open";
}

/// The real-time comment for the overload that packs a table.
std::string packing(const Method& method, const std::string& encoded) {
  if (method.is_stream) {
    return "@realtime set-up only: packs the request on the heap; " + encoded +
           "() takes a packed one";
  }
  return "@realtime set-up only: packs the request on the heap; in real time call " + encoded +
         "()";
}

/// The declarations of the begin_…() overloads.
std::string begin_methods(const Model& model, const Service& service, const Method& method) {
  if (!can_begin(method)) return {};
  const std::string name = method_name(service, method);
  const bool is_table = method.request.kind == PayloadKind::kTable;
  const std::string type = payload_type(model, method.request);
  Function head{.lead = "[[nodiscard]] ",
                .result = begin_result(model, method),
                .name = begin_name(method),
                .parameters = {"const " + type + (is_table ? "T" : "") + "& request", kOptions},
                .tail = ";"};
  if (method.request.kind == PayloadKind::kEmpty) head.parameters.front() += " = {}";
  std::string text = comment({"Begins " + name + "() and returns; take the reply later.",
                              "@realtime allocates the call's state; waiting and taking do not"},
                             "  ") +
                     function(head, "  ");
  if (!is_table) return text;
  head.name += "_encoded";
  head.parameters.front() = "::rtpm::ConstBytes request";
  return text + function(head, "  ");
}

/// The comment that says what success means for a oneway method without confirmation.
Documentation promise(const Method& method) {
  if (method.oneway != OnewayLevel::kSent) return {};
  return {"@return ok: sent, and may still get lost; see ::rtpm::rpc::Binding::send()",
          "@errors kMaybeLost: earlier ones may be lost · others: this one was not sent"};
}

std::string client_method(const Model& model, const Service& service, const Method& method) {
  Function head{.lead = "[[nodiscard]] ",
                .result = client_result(model, method),
                .name = method_name(service, method),
                .parameters = {"const " + payload_type(model, method.request) + "& request",
                               method.is_stream ? kStreamOptions : kOptions},
                .tail = method.is_stream ? ";" : " noexcept;"};
  const std::string docs =
      comment(documentation_of(model, method), "  ") + comment(promise(method), "  ");
  if (method.request.kind == PayloadKind::kEmpty) head.parameters.front() += " = {}";
  if (method.request.kind != PayloadKind::kTable) {
    return docs + comment({real_time(method)}, "  ") + function(head, "  ") +
           begin_methods(model, service, method);
  }
  Function encoded = head;
  encoded.name += "_encoded";
  encoded.parameters.front() = "::rtpm::ConstBytes request";
  const std::string table = payload_type(model, method.request);
  head.parameters.front() = "const " + table + "T& request";
  head.tail = ";";
  return docs + comment({packing(method, encoded.name)}, "  ") + function(head, "  ") +
         comment({"As " + head.name + "(), of a finished FlatBuffer of " + table.substr(2) + '.',
                  real_time(method)},
                 "  ") +
         function(encoded, "  ") + begin_methods(model, service, method);
}

std::string client_class(const Model& model, const Service& service) {
  const std::string name = short_name(service.name) + "Client";
  std::string text = comment(service.documentation, "");
  if (!service.documentation.empty()) text += "///\n";
  text += comment(
      {"The client side of " + service.name + '.',
       "@ownership refers to the node it was bound with, which must outlive it",
       "@threads  any, several calls at once", "@errors   of calls: ::rtpm::rpc::CallError"},
      "");
  if (service.priority) text += comment({priority_facts(service)}, "");
  text += "class " + name + " {\n public:\n";
  text +=
      "  /// The interface that the calls expect of the object.\n"
      "  [[nodiscard]] static const ::rtpm::rpc::InterfaceDescriptor& interface() noexcept;\n\n";
  text += comment(
      {"Binds to an object.",
       "@param target  a URL \"rtpm://host:port/path\", or a name for the node's resolver",
       "@realtime set-up only",
       "@errors   a text with the remedy; if the interface differs, with the method that does"},
      "  ");
  text += "  [[nodiscard]] static ::rtpm::expected<" + name +
          ", ::rtpm::SetupError> bind(\n"
          "      ::rtpm::rpc::Node& node, ::std::string_view target,\n"
          "      const ::rtpm::rpc::BindOptions& options = {});\n";
  for (const Method& method : service.methods)
    text += '\n' + client_method(model, service, method);
  text +=
      "\n  /// For opening more channels, and for the object's address.\n"
      "  [[nodiscard]] ::rtpm::rpc::Binding& binding() noexcept { return rtpm_binding_; }\n\n"
      " private:\n"
      "  explicit " +
      name +
      "(::rtpm::rpc::Binding binding) noexcept\n"
      "      : rtpm_binding_(::std::move(binding)) {}\n\n"
      "  ::rtpm::rpc::Binding rtpm_binding_;\n};\n";
  return text;
}

std::string servant_method(const Model& model, const Service& service, const Method& method) {
  Function head{.lead = "virtual ",
                .result = servant_result(model, method),
                .name = method_name(service, method),
                .parameters = {},
                .tail = " = 0;"};
  Documentation lines = documentation_of(model, method);
  for (const Parameter& parameter : servant_parameters(model, method))
    head.parameters.push_back(parameter.type + ' ' + parameter.name);
  if (method.is_stream) {
    lines.push_back("Keep `items` and write to it, on any thread, until you finish it.");
  } else if (method.is_deferred) {
    lines.push_back("Keep `reply` and complete it later, on any thread.");
  } else if (method.reply.kind == PayloadKind::kTable) {
    lines.push_back("Build the reply in `reply` and finish it once.");
  }
  return comment(lines, "  ") + function(head, "  ");
}

std::string servant_class(const Model& model, const Service& service) {
  const std::string name = short_name(service.name) + "Servant";
  std::string text = comment(service.documentation, "");
  if (!service.documentation.empty()) text += "///\n";
  text += comment({"The server side of " + service.name + ": derive from it and write the methods.",
                   "A request was checked against the schema.",
                   "@ownership a request is valid during the call only",
                   "@realtime as the methods; a lane's thread runs them",
                   "@threads  those of every lane that serves the object, concurrently"},
                  "");
  if (service.priority) text += comment({priority_facts(service)}, "");
  text += "class " + name + " : public ::rtpm::rpc::Servant {\n public:\n";
  for (const Method& method : service.methods)
    text += servant_method(model, service, method) + '\n';
  text +=
      "  [[nodiscard]] const ::rtpm::rpc::InterfaceDescriptor& interface() const noexcept "
      "final;\n\n"
      "  /// Runs the method `method_id`; the server calls it.\n"
      "  ::rtpm::rpc::DispatchResult dispatch(\n"
      "      ::std::uint16_t method_id, ::rtpm::ConstBytes request, ::rtpm::MutableBytes reply,\n"
      "      const ::rtpm::rpc::CallContext& context) override;\n};\n";
  return text;
}

std::string method_ids(const Service& service) {
  std::string text = "/// The methods' numbers on the wire.\n";
  text += "enum class " + short_name(service.name) + "MethodId : ::std::uint16_t {\n";
  for (const Method& method : service.methods) {
    text += "  " + method_name(service, method) + " = " + std::to_string(method.id) + ",\n";
  }
  return text + "};\n";
}

}  // namespace

std::string banner(const Model& model, const std::string& compiler_version) {
  return "// Generated by rtpmc " + compiler_version + " from " + model.file_stem +
         ".fbs. Do not edit it: change the schema.\n";
}

std::string payload_type(const Model& model, const Payload& payload) {
  switch (payload.kind) {
    case PayloadKind::kEmpty:
      return "::rtpm::rpc::Empty";
    case PayloadKind::kStruct:
      return type_name(model.objects[*payload.struct_index].name);
    case PayloadKind::kTable:
      break;
  }
  return type_name(model.objects[payload.table].name);
}

std::string reply_handle(const Model& model, const Method& method, const std::string& stem) {
  const std::string type = payload_type(model, method.reply);
  switch (method.reply.kind) {
    case PayloadKind::kEmpty:
      return "::rtpm::rpc::" + stem + "Nothing";
    case PayloadKind::kStruct:
      return "::rtpm::rpc::" + stem + "Struct<" + type + '>';
    case PayloadKind::kTable:
      break;
  }
  return "::rtpm::rpc::" + stem + "Table<" + type + '>';
}

std::string deferred_type(const Model& model, const Method& method) {
  if (!method.is_stream) return reply_handle(model, method, "Deferred");
  const bool is_table = method.reply.kind == PayloadKind::kTable;
  return std::string("::rtpm::rpc::") + (is_table ? "TableWriter<" : "StructWriter<") +
         payload_type(model, method.reply) + '>';
}

std::vector<Parameter> servant_parameters(const Model& model, const Method& method) {
  std::vector<Parameter> parameters;
  if (method.request.kind != PayloadKind::kEmpty) {
    parameters.push_back({"const " + payload_type(model, method.request) + '&', "request"});
  }
  if (method.is_stream) {
    parameters.push_back({deferred_type(model, method), "items"});
  } else if (method.is_deferred) {
    parameters.push_back({deferred_type(model, method), "reply"});
  } else if (method.reply.kind == PayloadKind::kTable) {
    parameters.push_back(
        {"::rtpm::rpc::ReplyBuilder<" + payload_type(model, method.reply) + ">&", "reply"});
  }
  parameters.push_back({"const ::rtpm::rpc::CallContext&", "context"});
  return parameters;
}

bool can_begin(const Method& method) noexcept {
  return !method.is_stream && !method.oneway;
}

std::string begin_name(const Method& method) {
  return "begin_" + method.name;
}

std::string begin_result(const Model& model, const Method& method) {
  return "::rtpm::expected<" + reply_handle(model, method, "Pending") + ", ::rtpm::rpc::CallError>";
}

std::string stream_type(const Model& model, const Method& method) {
  const bool is_table = method.reply.kind == PayloadKind::kTable;
  return std::string("::rtpm::rpc::") + (is_table ? "TableStream<" : "StructStream<") +
         payload_type(model, method.reply) + '>';
}

std::string client_result(const Model& model, const Method& method) {
  if (method.is_stream) {
    return "::rtpm::expected<" + stream_type(model, method) + ", ::rtpm::rpc::CallError>";
  }
  std::string value = "void";
  if (method.reply.kind == PayloadKind::kStruct) value = payload_type(model, method.reply);
  if (method.reply.kind == PayloadKind::kTable) {
    value = "::rtpm::rpc::TableReply<" + payload_type(model, method.reply) + '>';
  }
  return "::rtpm::expected<" + value + ", ::rtpm::rpc::CallError>";
}

std::string servant_result(const Model& model, const Method& method) {
  if (method.is_stream || method.is_deferred) return "void";
  const bool is_struct = method.reply.kind == PayloadKind::kStruct;
  return "::rtpm::rpc::Result<" + (is_struct ? payload_type(model, method.reply) : "void") + '>';
}

/// Makes a compiler for an older language standard print one sentence instead of many errors.
constexpr const char* kLanguageCheck =
    "#if __cplusplus < 202002L && !(defined(_MSVC_LANG) && _MSVC_LANG >= 202002L)\n"
    "#error \"RTPM needs C++20: compile with -std=c++20, or set CMAKE_CXX_STANDARD to 20\"\n"
    "#else\n\n";

std::string header(const Model& model, const std::string& compiler_version) {
  std::string text = banner(model, compiler_version) + "#pragma once\n\n";
  if (model.services.empty()) return text + data_includes(model);
  text += kLanguageCheck;
  text += "#include <cstdint>\n#include <string_view>\n#include <utility>\n\n";
  text += data_includes(model);
  text +=
      "#include \"rtpm/rpc/generated.hpp\"\n\n"
      "static_assert(::rtpm::rpc::kGeneratedForm == 2,\n"
      "              \"generated by an rtpmc of another version than RTPM's headers: run it again "
      "for " +
      model.file_stem + ".fbs\");\n";
  for (const Service& service : model.services) {
    const std::string scope = namespace_name(namespace_of(service.name));
    text += '\n';
    if (!scope.empty()) text += "namespace " + scope + " {\n\n";
    text += method_ids(service) + '\n' + client_class(model, service) + '\n' +
            servant_class(model, service);
    if (!scope.empty()) text += "\n}  // namespace " + scope + '\n';
  }
  return text + "\n#endif\n";
}

}  // namespace rtpm::schema::cpp
