#include "program/command_line.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {
namespace {

constexpr std::string_view kHelp =
    R"(usage: rtpmc [-I DIR]... (--cpp | --emit LANGUAGE)... [-o OUT] [--depfile FILE] SCHEMA
       rtpmc check [-I DIR]... [--conform OLD [--strict]] SCHEMA

Generates code for the rpc_services of a FlatBuffers schema, or checks the schema. SCHEMA is a .fbs
or a .bfbs. C++ is OUT/NAME.rtpm.hpp and OUT/NAME.rtpm.cpp; the data types come from flatc:
flatc --cpp --scoped-enums --gen-object-api. In CMake, rtpm_generate() calls both.

  -I DIR          search DIR for included schemas; may be given several times. RTPM's own are
                  found without
  --emit LANGUAGE generate it; may be given several times. The languages are:
@  --cpp           the same as --emit cpp
  -o OUT          the folder to write to; it is made if it lacks. Without it, json is printed
  --depfile FILE  write what the output depends on, for Make and Ninja
  --conform OLD   compare with the older schema OLD: clients built from it must work with servers
                  built from SCHEMA. Every change is told; generating stops where one breaks that
  --strict        servers built from OLD must also work with clients built from SCHEMA
  --print-idl-folder  print where RTPM's own schemas are, for flatc
  --help          show this text
  --version       show the version

Exit: 0 done, 1 an error in the schema or in writing (nothing is written), 2 a wrong command line.
)";

std::string help() {
  std::string text(kHelp);
  std::string languages;
  for (const BackEndEntry& entry : back_ends()) {
    languages.append("                    ").append(entry.name);
    languages.append(8 - std::min<std::size_t>(7, entry.name.size()), ' ');
    languages.append(entry.summary).append(1, '\n');
  }
  return text.replace(text.find('@'), 1, languages);
}

class Reader {
 public:
  explicit Reader(std::span<const char* const> arguments) : arguments_(arguments) {}

  std::variant<Command, UsageError, Answer> read(const std::string& version) {
    if (!arguments_.empty() && std::string_view(arguments_[0]) == "check") {
      command_.is_check = true;
      ++at_;
    }
    while (at_ < arguments_.size()) {
      const std::string_view argument = arguments_[at_++];
      if (argument == "--help" || argument == "-h") return Answer{help()};
      if (argument == "--version") return Answer{"rtpmc " + version + '\n'};
      if (argument == "--print-idl-folder") return print_idl_folder();
      if (auto error = take(argument)) return *std::move(error);
    }
    if (auto error = check()) return *std::move(error);
    return std::move(command_);
  }

 private:
  /// Checks the combination of arguments.
  [[nodiscard]] std::optional<UsageError> check() const {
    if (command_.schema.empty()) return UsageError{"no schema is given: add a FILE.fbs"};
    if (command_.is_strict && command_.conform.empty()) {
      return UsageError{
          "`--strict` says how to compare, and there is nothing to compare with: add "
          "--conform OLD.fbs"};
    }
    if (command_.is_check) {
      const bool is_generating = !command_.languages.empty() || !command_.output_folder.empty() ||
                                 !command_.dependency_file.empty();
      if (!is_generating) return std::nullopt;
      return UsageError{"`check` generates nothing: leave out --cpp, --emit, -o and --depfile"};
    }
    if (command_.languages.empty()) return UsageError{"no language is given: add --cpp"};
    const bool is_printing =
        command_.languages == std::vector<std::string>{"json"} && command_.dependency_file.empty();
    if (command_.output_folder.empty() && !is_printing) {
      return UsageError{"no output folder is given: add -o OUT"};
    }
    return std::nullopt;
  }

  std::optional<UsageError> take(std::string_view argument) {
    if (argument == "--cpp") return add_language("cpp");
    if (argument == "--emit") {
      std::string language;
      if (auto error = take_value(argument, language, "a language")) return error;
      return add_language(language);
    }
    if (argument == "-o") return take_value(argument, command_.output_folder);
    if (argument == "--depfile") return take_value(argument, command_.dependency_file);
    if (argument == "--conform") return take_value(argument, command_.conform);
    if (argument == "--strict") {
      command_.is_strict = true;
      return std::nullopt;
    }
    if (argument.starts_with("-I")) {
      std::string path(argument.substr(2));
      if (path.empty()) {
        if (auto error = take_value("-I", path)) return error;
      }
      command_.include_paths.push_back(std::move(path));
      return std::nullopt;
    }
    if (argument.starts_with("-") && argument != "-") {
      return UsageError{"unknown flag `" + std::string(argument) +
                        "`: rtpmc --help lists the flags there are"};
    }
    if (!command_.schema.empty()) {
      return UsageError{"two schemas are given, \"" + command_.schema + "\" and \"" +
                        std::string(argument) + "\": run rtpmc once for each"};
    }
    command_.schema = argument;
    return std::nullopt;
  }

  static std::variant<Command, UsageError, Answer> print_idl_folder() {
    const std::string folder = idl_folder();
    if (!folder.empty()) return Answer{folder + '\n'};
    return UsageError{
        "RTPM's own schemas are not where they were when rtpmc was built, nor "
        "beside it: name their folder with -I"};
  }

  std::optional<UsageError> add_language(std::string_view name) {
    const auto entries = back_ends();
    const bool is_known =
        std::any_of(entries.begin(), entries.end(),
                    [&](const BackEndEntry& entry) { return entry.name == name; });
    if (!is_known) {
      return UsageError{"unknown language `" + std::string(name) +
                        "`: rtpmc --help lists the languages there are"};
    }
    auto& languages = command_.languages;
    if (std::find(languages.begin(), languages.end(), name) == languages.end()) {
      languages.emplace_back(name);
    }
    return std::nullopt;
  }

  std::optional<UsageError> take_value(std::string_view flag, std::string& value,
                                       const char* what = "a path") {
    const std::string name(flag);
    if (at_ == arguments_.size() || *arguments_[at_] == '\0') {
      return UsageError{'`' + name + "` needs " + what + " behind it: rtpmc --help shows how"};
    }
    if (!value.empty()) return UsageError{'`' + name + "` is given twice: keep one of the two"};
    value = arguments_[at_++];
    return std::nullopt;
  }

  std::span<const char* const> arguments_;
  std::size_t at_ = 0;
  Command command_{};
};

}  // namespace

std::string idl_folder() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto installed = (program.parent_path() / "../share/rtpm/idl").lexically_normal();
  for (const std::filesystem::path& folder : {installed, std::filesystem::path(RTPM_IDL_FOLDER)}) {
    if (std::filesystem::exists(folder / "rtpm.fbs", error)) return folder.string();
  }
  return {};
}

std::variant<Command, UsageError, Answer> read_command_line(std::span<const char* const> arguments,
                                                            const std::string& version) {
  return Reader(arguments).read(version);
}

}  // namespace rtpm::schema
