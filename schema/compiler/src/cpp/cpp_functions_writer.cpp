#include <string>

#include "cpp/cpp_names.hpp"
#include "cpp/cpp_writer.hpp"

// Servants made of functions have their own header: instances of std::function would slow down
// compilation of every file that includes the main header.
namespace rtpm::schema::cpp {
namespace {

std::string functions_struct(const Model& model, const Service& service) {
  const std::string stem = short_name(service.name);
  std::string text =
      comment({"The methods of " + service.name + " as functions, which take what those of " +
                   stem + "Servant take.",
               "A call of a method whose function is empty fails with kNoSuchMethod."},
              "");
  text += "struct " + stem + "Functions {\n";
  for (const Method& method : service.methods) {
    std::string parameters;
    for (const Parameter& parameter : servant_parameters(model, method))
      parameters += (parameters.empty() ? "" : ", ") + parameter.type;
    const std::string type =
        "  ::std::function<" + servant_result(model, method) + '(' + parameters + ")>";
    const std::string member = method_name(service, method) + "{};\n";
    constexpr std::size_t kColumnMax = 100;
    text += type + (type.size() + 1 + member.size() > kColumnMax + 1 ? "\n      " : " ") + member;
  }
  return text + "};\n";
}

std::string method(const Model& model, const Service& service, const Method& method) {
  const std::string name = method_name(service, method);
  Function head{
      .lead = "", .result = servant_result(model, method), .name = name, .parameters = {}};
  head.tail = " override {";
  std::string arguments;
  for (const Parameter& parameter : servant_parameters(model, method)) {
    head.parameters.push_back(parameter.type + ' ' + parameter.name);
    const bool is_handle = !parameter.type.ends_with('&');
    arguments += (arguments.empty() ? "" : ", ") +
                 (is_handle ? "::std::move(" + parameter.name + ')' : parameter.name);
  }
  return function(head, "  ") + "    return rtpm_functions_." + name + '(' + arguments +
         ");\n  }\n";
}

std::string dispatch(const Service& service) {
  const std::string stem = short_name(service.name);
  std::string text =
      "  ::rtpm::rpc::DispatchResult dispatch(\n"
      "      ::std::uint16_t method_id, ::rtpm::ConstBytes request, ::rtpm::MutableBytes reply,\n"
      "      const ::rtpm::rpc::CallContext& context) override {\n"
      "    bool is_there = true;\n"
      "    switch (static_cast<" +
      stem + "MethodId>(method_id)) {\n";
  for (const Method& method : service.methods) {
    const std::string name = method_name(service, method);
    text += "      case " + stem + "MethodId::" + name +
            ":\n        is_there = static_cast<bool>(rtpm_functions_." + name +
            ");\n        break;\n";
  }
  return text +
         "    }\n"
         "    if (!is_there) return {::rtpm::wire::Status::kNoSuchMethod, 0};\n"
         "    return " +
         stem + "Servant::dispatch(method_id, request, reply, context);\n  }\n";
}

std::string servant(const Model& model, const Service& service) {
  const std::string stem = short_name(service.name);
  const std::string name = stem + "FunctionServant";
  std::string text =
      comment({"A servant made of functions: " + stem + "FunctionServant arm({." +
                   method_name(service, service.methods.front()) + " = [&](auto&&...) { ... }});",
               "@realtime as the functions; calling them does not allocate",
               "@threads  as " + stem + "Servant"},
              "");
  text += "class " + name + " final : public " + stem +
          "Servant {\n public:\n"
          "  explicit " +
          name + '(' + stem +
          "Functions functions)\n      : rtpm_functions_(::std::move(functions)) {}\n\n";
  for (const Method& one : service.methods)
    text += method(model, service, one);
  return text + dispatch(service) + "\n private:\n  " + stem + "Functions rtpm_functions_;\n};\n";
}

}  // namespace

std::string functions_header(const Model& model, const std::string& compiler_version) {
  std::string text = banner(model, compiler_version) + "#pragma once\n\n";
  if (!model.services.empty()) text += "#include <functional>\n#include <utility>\n\n";
  text += "#include " + literal(model.file_stem + ".rtpm.hpp") + '\n';
  for (const Service& service : model.services) {
    if (service.methods.empty()) continue;
    const std::string scope = namespace_name(namespace_of(service.name));
    text += '\n';
    if (!scope.empty()) text += "namespace " + scope + " {\n\n";
    text += functions_struct(model, service) + '\n' + servant(model, service);
    if (!scope.empty()) text += "\n}  // namespace " + scope + '\n';
  }
  return text;
}

}  // namespace rtpm::schema::cpp
