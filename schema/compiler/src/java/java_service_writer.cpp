#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emit/prose.hpp"
#include "java/java_writer.hpp"
#include "model/quantities.hpp"
#include "model/ranged_types.hpp"
#include "model/reach.hpp"
#include "model/words.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "rtpm/schema/schema_text.hpp"

// A service's methods, its client and its servant.
namespace rtpm::schema::java {
namespace {

std::string kind(const Method& method) {
  if (method.is_stream) return "STREAM";
  if (method.oneway == OnewayLevel::kSent) return "ONEWAY";
  return method.oneway == OnewayLevel::kReceived ? "RECEIPT" : "CALL";
}

std::string role(Role role) {
  switch (role) {
    case Role::kObserve:
      return "OBSERVE";
    case Role::kCommand:
      return "COMMAND";
    case Role::kConfigure:
      return "CONFIGURE";
    case Role::kAdminister:
      break;
  }
  return "ADMINISTER";
}

/// Functions check() for the types with ranges that requests reach.
class Checks {
 public:
  Checks(const Context& context, const Service& service)
      : context_(context), service_(service), types_(context.model) {}

  [[nodiscard]] bool are_in(const Payload& request) const { return types_.has(request); }

  [[nodiscard]] std::string functions() const {
    Reach reach;
    for (const Method& method : service_.methods) {
      if (method.request.kind == PayloadKind::kEmpty) continue;
      reach.add(context_.model, method.request.struct_index.value_or(method.request.table));
    }
    std::string text;
    for (const std::size_t index : reach.objects) {
      if (types_.has_object(index)) text += of_object(context_.model.objects[index]);
    }
    for (const std::size_t index : reach.enums) {
      if (types_.has_union(index)) text += of_union(context_.model.enums[index]);
    }
    return text;
  }

 private:
  static std::string head(const std::string& type) {
    return "\n  private static void check(" + type + " value) {\n";
  }

  [[nodiscard]] std::string of_object(const Object& object) const {
    std::string text = head(context_.name(object));
    for (const Field& field : object.fields) {
      if (field.is_deprecated || (!field.range && !types_.has(field.type))) continue;
      const std::string value = "value." + context_.names.member(field.name) + "()";
      if (!field.type.is_many()) {
        const bool may_be_absent =
            field.range ? field.is_optional : !object.is_struct && !field.is_required;
        const std::string line = statement(object, field, value);
        text += may_be_absent ? "    if (" + value + " != null) {\n      " + line + "    }\n"
                              : "    " + line;
        continue;
      }
      std::string type = value_type(context_, field.type, false);
      type =
          type.ends_with("[]") ? type.substr(0, type.size() - 2) : type.substr(5, type.size() - 6);
      text += "    for (" + type + " item : " + value + ") {\n      " +
              statement(object, field, "item") + "    }\n";
    }
    return text + "  }\n";
  }

  [[nodiscard]] std::string of_union(const Enum& enumeration) const {
    const std::string type = context_.name(enumeration);
    std::string text = head(type);
    for (const EnumValue& value : enumeration.values) {
      if (!types_.has(value.union_type)) continue;
      text += "    if (value instanceof " + type + '.' + context_.names.type(value.name) +
              " one) {\n      check(one.value());\n    }\n";
    }
    return text + "  }\n";
  }

  static std::string statement(const Object& object, const Field& field, const std::string& value) {
    if (!field.range) return "check(" + value + ");\n";
    const std::string low = number_text(field.range->low);
    const std::string high = number_text(field.range->high);
    std::string number = value + (field.type.index ? ".value()" : "");
    if (field.type.innermost() == BaseType::kUint64) number = "Scalars.real(" + number + ')';
    if (field.type.is_many() && field.type.element == BaseType::kUint8) number += " & 0xff";
    return "Scalars.range(" + literal(short_name(object.name) + '.' + field.name) + ", " + number +
           ", " + real_literal(field.range->low, false) + ", " +
           real_literal(field.range->high, false) + ", " +
           literal(low + " to " + high + (field.unit.empty() ? "" : ' ' + field.unit)) + ");\n";
  }

  const Context& context_;
  const Service& service_;
  RangedTypes types_;
};

std::string method_type(const Context& context, const Method& method) {
  return "Method<" + payload_type(context, method.request) + ", " +
         payload_type(context, method.reply) + '>';
}

std::string method_constant(const Context& context, const Checks& checks, const Method& method) {
  std::string request = payload_codec(context, method.request);
  if (checks.are_in(method.request)) {
    request = "Codecs.checked(" + request + ", value -> check(value))";
  }
  const std::string deadline =
      method.deadline_us
          ? "Duration.ofNanos(" + std::to_string(std::uint64_t{*method.deadline_us} * 1000) + "L)"
          : "Duration.ZERO";
  const std::vector<std::string> arguments{literal(method.name),
                                           std::to_string(method.id),
                                           "Kind." + kind(method),
                                           request,
                                           payload_codec(context, method.reply),
                                           hexadecimal(method.fingerprint, 8) + 'L',
                                           method.is_idempotent ? "true" : "false",
                                           deadline,
                                           "Role." + role(method.role),
                                           std::to_string(method.max_size.value_or(0))};
  return "  /** {@code " + ascii(method.name) + "}. */\n  public static final " +
         method_type(context, method) + ' ' + Names::constant(method.name) +
         " =\n      new Method<>(\n          " + emit::joined(arguments, ",\n          ") +
         ");\n\n";
}

GeneratedFile methods_file(const Context& context, const Service& service,
                           const std::string& package) {
  const std::string type = short_name(service.name) + "Methods";
  const Checks checks(context, service);
  std::string body =
      "/** The methods of " + service.name + ". */\npublic final class " + type + " {\n";
  std::vector<std::string> names;
  for (const Method& method : service.methods) {
    body += method_constant(context, checks, method);
    names.push_back(Names::constant(method.name));
  }
  const std::string model = service.priority_model == PriorityModel::kServerDeclared
                                ? "SERVER_DECLARED"
                                : "CLIENT_PROPAGATED";
  const std::vector<std::string> arguments{
      literal(service.name),
      hexadecimal(service.fingerprint, 16) + 'L',
      emit::call("List.<Method<?, ?>>of", names, "", "              "),
      "PriorityModel." + model,
      service.priority ? std::to_string(*service.priority) : "-1",
      text_block(interface_text(context.model, service)),
      text_block(schema_text(context.model, service)),
      literal(context.compiler_version)};
  body +=
      "  /** The interface, to bind or serve an object with it. */\n"
      "  public static final Interface INTERFACE =\n      new Interface(\n          " +
      emit::joined(arguments, ",\n          ") + ");\n\n  private " + type + "() {}\n" +
      checks.functions() + "}\n";
  return file(context, package, type, body);
}

/// A class's comment: the service's own, and `more`.
std::string service_comment(const Service& service, const Documentation& more) {
  Documentation lines = service.documentation;
  emit::add_paragraph(lines, more);
  if (const std::string facts = priority_facts(service); !facts.empty()) lines.push_back(facts);
  return comment(lines, "");
}

std::string client_method(const Context& context, const Service& service, const Method& method) {
  const std::string name = context.names.member(method.name);
  const std::string reply = payload_type(context, method.reply);
  const bool is_sent = method.oneway == OnewayLevel::kSent;
  const std::string result = method.is_stream ? "Flow.Publisher<" + reply + '>'
                             : is_sent        ? "void"
                                              : "CompletableFuture<" + reply + '>';
  const std::string function = method.is_stream ? "stream" : is_sent ? "send" : "call";
  const bool is_empty = method.request.kind == PayloadKind::kEmpty;
  std::vector<std::string> parameters;
  if (!is_empty) parameters.push_back(payload_type(context, method.request) + " request");
  const std::string argument = is_empty ? "null" : "request";
  const std::string docs = method_comment(context, method);
  const std::string head = "  public " + result + ' ' + name;
  const std::string give = is_sent ? "    caller." : "    return caller.";
  const std::string constant = short_name(service.name) + "Methods." + Names::constant(method.name);
  std::string text = "\n" + docs + emit::call(head, parameters, " {\n", "    ") + give + function +
                     '(' + constant + ", " + argument + ");\n  }\n";
  parameters.emplace_back("CallOptions options");
  return text + "\n  /** As " + name + ", with options. */\n" +
         emit::call(head, parameters, " {\n", "    ") + give + function + '(' + constant + ", " +
         argument + ", options);\n  }\n";
}

GeneratedFile client_file(const Context& context, const Service& service,
                          const std::string& package) {
  const std::string stem = short_name(service.name);
  std::string body =
      service_comment(service, {"The client side of " + service.name +
                                ". Threads: any, several calls at once."}) +
      "public final class " + stem +
      "Client {\n  private final Caller caller;\n\n"
      "  /**\n   * Calls an object.\n   *\n   * @param caller what is bound to it with {@link " +
      stem + "Methods#INTERFACE}\n   */\n  public " + stem +
      "Client(Caller caller) {\n    this.caller = Objects.requireNonNull(caller);\n  }\n";
  for (const Method& method : service.methods)
    body += client_method(context, service, method);
  return file(context, package, stem + "Client", body + "}\n");
}

std::string servant_method(const Context& context, const Method& method) {
  const std::string reply = payload_type(context, method.reply);
  std::string result = reply == "Void" ? "void" : reply;
  if (method.is_stream) {
    result = "Flow.Publisher<" + reply + '>';
  } else if (method.is_deferred) {
    result = "CompletionStage<" + reply + '>';
  }
  std::vector<std::string> parameters;
  if (method.request.kind != PayloadKind::kEmpty) {
    parameters.push_back(payload_type(context, method.request) + " request");
  }
  parameters.emplace_back("CallContext context");
  const std::string docs = method_comment(context, method);
  return docs + emit::call("  " + result + ' ' + context.names.member(method.name), parameters,
                           " throws Exception;\n\n", "    ");
}

std::string operation(const Context& context, const Service& service, const Method& method) {
  const std::string kind_name = method.is_stream     ? "Stream"
                                : method.is_deferred ? "Deferred"
                                                     : "Plain";
  const std::string call = context.names.member(method.name) +
                           (method.request.kind == PayloadKind::kEmpty ? "(" : "(request, ") +
                           "context)";
  const bool is_void = kind_name == "Plain" && method.reply.kind == PayloadKind::kEmpty;
  const std::string indent(12, ' ');
  const std::string body = is_void ? "{\n" + indent + "      " + call + ";\n" + indent +
                                         "      return null;\n" + indent + "    }"
                                   : call;
  return "\n" + indent + "new Operation." + kind_name + "<>(\n" + indent + "    " +
         short_name(service.name) + "Methods." + Names::constant(method.name) + ",\n" + indent +
         "    (request, context) -> " + body + ')';
}

GeneratedFile servant_file(const Context& context, const Service& service,
                           const std::string& package) {
  const std::string stem = short_name(service.name);
  std::string body =
      service_comment(service, {"The server side of " + service.name +
                                ": write its methods. A request was checked against the schema."}) +
      "public interface " + stem + "Servant extends Servant {\n";
  std::vector<std::string> operations;
  for (const Method& method : service.methods) {
    body += servant_method(context, method);
    operations.push_back(operation(context, service, method));
  }
  body += "  @Override\n  default Skeleton skeleton() {\n    return new Skeleton(\n        " +
          stem + "Methods.INTERFACE,\n        List.<Operation<?, ?>>of(" +
          emit::joined(operations, ",") + "));\n  }\n}\n";
  return file(context, package, stem + "Servant", body);
}

}  // namespace

std::vector<GeneratedFile> service_files(const Context& context, const Service& service) {
  const std::string package =
      context.names.package_of(service.name, context.model.declaration_file);
  return {methods_file(context, service, package), client_file(context, service, package),
          servant_file(context, service, package)};
}

}  // namespace rtpm::schema::java
