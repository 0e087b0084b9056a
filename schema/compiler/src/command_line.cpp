#include "command_line.hpp"

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

namespace rtpm::schema {
namespace {

constexpr std::string_view kHelp =
    R"(usage: rtpmc [-I DIR]... --cpp -o OUT [--depfile FILE] FILE.fbs

Generates RTPM's C++ stubs and skeletons for the rpc_services of a FlatBuffers schema:
OUT/<name>.rtpm.hpp and OUT/<name>.rtpm.cpp. The data types come from flatc:
flatc --cpp --scoped-enums --gen-object-api. In CMake, rtpm_generate() calls both.

  -I DIR          search DIR for included schemas; may be given several times
  --cpp           generate C++20
  -o OUT          the folder to write to; it is made if it lacks
  --depfile FILE  write what the output depends on, for Make and Ninja
  --help          show this text
  --version       show the version

Exit: 0 done, 1 an error in the schema or in writing (nothing is written), 2 a wrong command line.
)";

class Reader {
 public:
  explicit Reader(std::span<const char* const> arguments) : arguments_(arguments) {}

  std::variant<Command, UsageError, Answer> read(const std::string& version) {
    while (at_ < arguments_.size()) {
      const std::string_view argument = arguments_[at_++];
      if (argument == "--help" || argument == "-h") return Answer{std::string(kHelp)};
      if (argument == "--version") return Answer{"rtpmc " + version + '\n'};
      if (auto error = take(argument)) return *std::move(error);
    }
    if (command_.schema.empty()) return UsageError{"no schema is given: add a FILE.fbs"};
    if (!is_cpp_) return UsageError{"no language is given: add --cpp"};
    if (command_.output_folder.empty()) return UsageError{"no output folder is given: add -o OUT"};
    return std::move(command_);
  }

 private:
  std::optional<UsageError> take(std::string_view argument) {
    if (argument == "--cpp") {
      is_cpp_ = true;
      return std::nullopt;
    }
    if (argument == "-o") return take_value(argument, command_.output_folder);
    if (argument == "--depfile") return take_value(argument, command_.dependency_file);
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

  std::optional<UsageError> take_value(std::string_view flag, std::string& value) {
    const std::string name(flag);
    if (at_ == arguments_.size() || *arguments_[at_] == '\0') {
      return UsageError{'`' + name + "` needs a path behind it: rtpmc --help shows how"};
    }
    if (!value.empty()) return UsageError{'`' + name + "` is given twice: keep one of the two"};
    value = arguments_[at_++];
    return std::nullopt;
  }

  std::span<const char* const> arguments_;
  std::size_t at_ = 0;
  bool is_cpp_ = false;
  Command command_{};
};

}  // namespace

std::variant<Command, UsageError, Answer> read_command_line(std::span<const char* const> arguments,
                                                            const std::string& version) {
  return Reader(arguments).read(version);
}

}  // namespace rtpm::schema
