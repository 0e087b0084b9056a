// Writes payloads of exchange.fbs by FlatBuffers' own code for programs in other languages, and
// compares those that they give back.
//
//     values_exchange encode SCHEMA IDL CASES FOLDER   writes FOLDER/<number>.<type>.cpp
//     values_exchange compare SCHEMA IDL FOLDER LANGUAGE   reads FOLDER/<number>.<type>.<LANGUAGE>
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace {

namespace fs = std::filesystem;
using rtpm::schema::Dynamic;

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

std::unique_ptr<Dynamic> load(const std::string& schema, const std::string& idl) {
  const auto result = rtpm::schema::compile({.file = schema, .include_paths = {idl}});
  std::string error = render(result.errors);
  std::unique_ptr<Dynamic> dynamic;
  if (result.model) dynamic = Dynamic::make(schema_text(*result.model), error);
  if (!dynamic) fail(error);
  return dynamic;
}

rtpm::schema::Payload payload_of(const Dynamic& dynamic, std::string_view type) {
  const auto& objects = dynamic.model().objects;
  const auto found = std::ranges::find_if(
      objects, [&](const auto& object) { return rtpm::schema::short_name(object.name) == type; });
  return rtpm::schema::payload_of(dynamic.model(),
                                  static_cast<std::size_t>(found - objects.begin()));
}

std::vector<std::byte> read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::byte> bytes(text.size());
  std::ranges::transform(text, bytes.begin(), [](char c) { return static_cast<std::byte>(c); });
  return bytes;
}

int encode(Dynamic& dynamic, const std::string& cases, const fs::path& folder) {
  std::ifstream lines(cases);
  std::string line;
  int number = 100;
  while (std::getline(lines, line)) {
    const std::string type = line.substr(0, line.find(' '));
    std::string error;
    const auto bytes =
        dynamic.encode(payload_of(dynamic, type), line.substr(type.size() + 1), error);
    if (!bytes) return fail(line + ": " + error);
    std::ofstream file(folder / (std::to_string(++number) + '.' + type + ".cpp"), std::ios::binary);
    for (const std::byte one : *bytes)
      file.put(static_cast<char>(one));
  }
  return number > 115 ? 0 : fail("there are only few cases");
}

/// Tables must have the same meaning, as FlatBuffers leave their writer a choice; structs the same
/// bytes.
int compare(Dynamic& dynamic, const fs::path& folder, const std::string& language) {
  int failures = 0;
  int count = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string type = entry.path().stem().extension().string().substr(1);
    const auto payload = payload_of(dynamic, type);
    fs::path path = entry.path();
    const auto theirs = read(path.replace_extension(language));
    const auto ours = read(entry.path());
    const auto expected = dynamic.decode(payload, ours);
    const auto actual = dynamic.decode(payload, theirs);
    ++count;
    if (expected && actual && *expected == *actual &&
        (payload.struct_index ? ours == theirs : true)) {
      continue;
    }
    ++failures;
    fail(path.string() + ":\n  expected " + expected.value_or("(no value)") + "\n  but was  " +
         actual.value_or("(no value)"));
  }
  std::printf("%d payloads of %s, %d differ\n", count, language.c_str(), failures);
  return failures == 0 && count > 15 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() != 5) return fail("values_exchange: see its source");
  const auto dynamic = load(arguments[1], arguments[2]);
  if (!dynamic) return 1;
  return arguments[0] == "encode" ? encode(*dynamic, arguments[3], arguments[4])
                                  : compare(*dynamic, arguments[3], arguments[4]);
}
