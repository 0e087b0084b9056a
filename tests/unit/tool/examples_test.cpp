#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "cli/program.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "rtpm/schema/schema_text.hpp"

// Checks every example of `rtpm` in a README, in the manual and in a command's help: the command
// exists and takes these options, and a call has a method and a request that its object accepts.
namespace rtpm::tool {
namespace {

namespace fs = std::filesystem;

struct Example {
  std::string place;  ///< "clients/rtpm/README.md", or the command with this help.
  std::string text;   ///< The line without its comment.
};

/// The words of a line as a shell splits it, up to a comment, a pipe, a redirection or another
/// command.
std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  for (std::size_t i = 0; i < line.size();) {
    if (line[i] == ' ') {
      ++i;
      continue;
    }
    if (std::string_view("#|>;&").find(line[i]) != std::string_view::npos) break;
    std::string& word = words.emplace_back();
    while (i < line.size() && line[i] != ' ') {
      const char c = line[i];
      const std::size_t close = c == '\'' || c == '"' ? line.find(c, i + 1) : std::string::npos;
      if (close == std::string::npos) {
        word += line[i++];
      } else {
        word += line.substr(i + 1, close - i - 1);
        i = close + 1;
      }
    }
  }
  return words;
}

std::string stripped(const std::string& line) {
  const std::size_t begin = line.find_first_not_of(' ');
  const std::string text = begin == std::string::npos ? std::string() : line.substr(begin);
  const std::string command = text.starts_with("$ ") ? text.substr(2) : text;
  return command.substr(0, command.find("   "));  // In a help, an explanation follows.
}

void take_lines(const std::string& place, const std::string& text, std::vector<Example>& examples) {
  std::istringstream lines(text);
  bool is_fenced = false;
  for (std::string line; std::getline(lines, line);) {
    for (std::string more; line.ends_with(" \\") && std::getline(lines, more);) {
      line.pop_back();
      line += more.substr(std::min(more.find_first_not_of(' '), more.size()));
    }
    if (line.starts_with("```")) is_fenced = !is_fenced;
    const bool is_code = is_fenced || line.starts_with("    ") || line.starts_with("  rtpm ");
    if (is_code && stripped(line).starts_with("rtpm ")) examples.push_back({place, stripped(line)});
  }
}

void take_help(const CLI::App& app, std::vector<Example>& examples) {
  take_lines("the help of " + app.get_name(), app.get_footer(), examples);
  for (const CLI::App* below : app.get_subcommands([](const CLI::App*) { return true; }))
    take_help(*below, examples);
}

std::string content_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<Example> examples() {
  std::vector<Example> found;
  for (const char* folder : {"clients", "devices", "docs", "examples", "gvd", "packaging",
                             "registry", "runtime", "schema"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(RTPM_SOURCE) / folder)) {
      if (entry.path().extension() == ".md")
        take_lines(fs::relative(entry.path(), RTPM_SOURCE), content_of(entry.path()), found);
    }
  }
  take_lines("README.md", content_of(fs::path(RTPM_SOURCE) / "README.md"), found);
  Context context;
  take_help(*make_program(context), found);
  return found;
}

/// The rtpm::schema::Dynamic of one of RTPM's services, or of a golden.
std::unique_ptr<schema::Dynamic> service(const char* file, std::string_view name) {
  const fs::path folder = fs::path(RTPM_SOURCE) / "schema";
  const auto compiled = schema::compile(
      {.file = (folder / file).string(), .include_paths = {(folder / "idl").string()}});
  if (!compiled.model) return nullptr;
  const auto found = std::ranges::find(compiled.model->services, name, &schema::Service::name);
  if (found == compiled.model->services.end()) return nullptr;
  std::string error;
  return schema::Dynamic::make(schema::schema_text(*compiled.model, *found), name, error);
}

/// The object that an example calls; by default a device of rtpm-deviced.
std::unique_ptr<schema::Dynamic> object_of(const Example& example, const std::string& target) {
  if (target.ends_with("rtpm/names")) return service("idl/names.fbs", "rtpm.names.Names");
  if (target.ends_with("rtpm/events")) return service("idl/events.fbs", "rtpm.events.Hub");
  if (example.place == "schema/README.md") return service("goldens/arm.fbs", "lab.Arm");
  return service("idl/device.fbs", "rtpm.device.Device");
}

TEST(Examples, AreCommandLinesThatRtpmAccepts) {
  const auto all = examples();
  EXPECT_GT(all.size(), 100u) << "some are not found";
  for (const Example& example : all) {
    Context context;
    const auto program = make_program(context);
    std::vector<std::string> words = words_of(example.text);
    words.erase(words.begin());
    std::ranges::reverse(words);
    try {
      program->parse(words);
    } catch (const CLI::CallForHelp&) {
    } catch (const CLI::Error& error) {
      ADD_FAILURE() << example.place << ": " << example.text << ": " << error.what();
    }
  }
}

TEST(Examples, CallMethodsWithRequestsThatTheObjectAccepts) {
  std::size_t count = 0;
  for (const Example& example : examples()) {
    const std::vector<std::string> words = words_of(example.text);
    // The tutorial's test covers the tutorial's own service.
    if (words.size() < 4 || words[1] != "call" || example.place == "schema/TUTORIAL.md") continue;
    const auto object = object_of(example, words[2]);
    ASSERT_NE(object, nullptr) << example.place << ": " << example.text;
    const schema::Method* const method = object->find(words[3]);
    ASSERT_NE(method, nullptr) << example.place << ": " << example.text << ": no such method";
    const bool has_request = words.size() > 4 && words[4].starts_with("{");
    std::string error;
    EXPECT_TRUE(object->encode(method->request, has_request ? words[4] : "", error))
        << example.place << ": " << example.text << ": " << error;
    ++count;
  }
  EXPECT_GT(count, 10u);
}

}  // namespace
}  // namespace rtpm::tool
