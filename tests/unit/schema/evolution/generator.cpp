#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

#include "cpp/cpp_names.hpp"
#include "cpp/cpp_writer.hpp"
#include "evolution_samples.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"

// Generates the code of all sampled schemas of one version, and a program that serves and calls
// them: generator before|after FLATC IDL-FOLDER OUT-FOLDER
namespace rtpm::schema {
namespace {

namespace fs = std::filesystem;

void write_file(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string bytes_literal(const std::string& bytes) {
  std::string text = "std::string_view(\"";
  constexpr const char* kDigits = "01234567";
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += {'\\', kDigits[byte >> 6], kDigits[(byte >> 3) & 7], kDigits[byte & 7]};
  }
  return text + "\", " + std::to_string(bytes.size()) + ")";
}

/// The body of a servant's method.
std::string answer(const Model& model, const Method& method, const std::string& bytes) {
  const std::string type = cpp::payload_type(model, method.reply);
  const std::string end = method.is_deferred ? "    reply.complete(" : "    return ";
  switch (method.reply.kind) {
    case PayloadKind::kEmpty:
      return method.is_deferred ? "    reply.complete();\n" : "    return {};\n";
    case PayloadKind::kStruct:
      return end + "evolution::as_struct<" + type + ">(" + bytes + ")" +
             (method.is_deferred ? ");\n" : ";\n");
    case PayloadKind::kTable:
      break;
  }
  const std::string fill = "evolution::fill(" +
                           std::string(method.is_deferred ? "builder" : "reply") + ", " + bytes +
                           ");\n";
  if (!method.is_deferred) return "    " + fill + "    return {};\n";
  return "    auto builder = reply.builder();\n    " + fill + "    reply.complete(builder);\n";
}

std::string servant_method(const Service& service, const Method& method, test::Side& side,
                           const std::string& sample) {
  const Model& model = side.model();
  std::string parameters;
  for (const cpp::Parameter& parameter : cpp::servant_parameters(model, method)) {
    parameters += (parameters.empty() ? "" : ", ") + parameter.type + ' ' +
                  (parameter.name == "context" ? "" : parameter.name);
  }
  const bool has_request = method.request.kind != PayloadKind::kEmpty;
  return "  " + cpp::servant_result(model, method) + ' ' + cpp::method_name(service, method) + '(' +
         parameters + ") override {\n    evolution::record(" + sample + ", " +
         std::to_string(method.id) + ", \"request\", " +
         (has_request ? "evolution::repack(request)" : "{}") + ");\n" +
         answer(model, method,
                bytes_literal(test::sample_message(side, method.reply, method.id, false))) +
         "  }\n";
}

std::string call(const Service& service, const Method& method, test::Side& side,
                 const std::string& sample) {
  const Model& model = side.model();
  const std::string bytes =
      bytes_literal(test::sample_message(side, method.request, method.id, true));
  std::string name = cpp::method_name(service, method);
  std::string argument = "{}";
  if (method.request.kind == PayloadKind::kStruct) {
    argument =
        "evolution::as_struct<" + cpp::payload_type(model, method.request) + ">(" + bytes + ")";
  } else if (method.request.kind == PayloadKind::kTable) {
    name += "_encoded";
    argument = "evolution::as_bytes(" + bytes + ")";
  }
  return "  evolution::answered(" + sample + ", " + std::to_string(method.id) + ", client->" +
         name + '(' + argument + ", evolution::kOptions));\n";
}

std::string code_of(test::Side& side, const std::string& sample) {
  const Service& service = side.model().services.front();
  const std::string scope = "lab" + sample;
  std::string text = "#include \"s" + sample + ".rtpm.cpp\"\nnamespace " + scope +
                     " {\nclass Served final : public ArmServant {\n public:\n";
  for (const Method& method : service.methods)
    text += servant_method(service, method, side, sample);
  text +=
      "};\nvoid call(::rtpm::rpc::Node& node, const std::string& url) {\n"
      "  auto client = evolution::bind<ArmClient>(" +
      sample +
      ", node, url);\n"
      "  if (!client) return;\n";
  for (const Method& method : service.methods)
    text += call(service, method, side, sample);
  return text + "}\n}  // namespace " + scope + '\n';
}

int run(const std::string& version, const std::string& flatc, const std::string& idl,
        const fs::path& out) {
  fs::create_directories(out);
  std::string program = "#include \"side.hpp\"\n";
  std::string table = "const std::vector<evolution::Sample> evolution::kSamples{\n";
  std::string schemas;
  int number = 0;
  for (const test::EvolutionSample& sample : test::evolution_samples()) {
    const std::string name = std::to_string(number++);
    test::Side side(version == "before" ? sample.before : sample.after);
    const fs::path schema = out / ("s" + name + ".fbs");
    write_file(schema, side.schema().text());
    schemas += " '" + schema.string() + '\'';
    const CompileResult result = compile({.file = schema.string(), .include_paths = {idl}});
    if (!result.model) {
      std::cerr << render(result.errors);
      return 1;
    }
    for (const GeneratedFile& file : make_cpp_back_end("0")->generate(*result.model))
      write_file(out / file.name, file.text);
    program += code_of(side, name);
    table += "    {\"s" + name + "\", std::make_shared<lab" + name + "::Served>(), lab" + name +
             "::call},\n";
  }
  write_file(out / "program.cpp", program + table + "};\n");
  return std::system(('\'' + flatc +
                      "' --cpp --cpp-std c++17 --scoped-enums --gen-object-api -I '" + idl +
                      "' -o '" + out.string() + '\'' + schemas)
                         .c_str()) == 0
             ? 0
             : 1;
}

}  // namespace
}  // namespace rtpm::schema

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  return rtpm::schema::run(argv[1], argv[2], argv[3], argv[4]);
}
