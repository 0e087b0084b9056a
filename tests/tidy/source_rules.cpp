#include "source_rules.hpp"

#include <algorithm>
#include <regex>
#include <set>
#include <string>
#include <utility>

namespace rtpm::tidy {
namespace {

constexpr std::size_t kFileLineMax = 800;

/// Whether a rule reads comments and texts as well as code.
enum class Reads { kCode, kEverything };

struct Rule {
  std::string_view name;
  std::regex pattern;
  Reads reads;
  std::vector<std::string_view> folders;  ///< Empty: the whole tree.
  std::string_view remedy;
  std::string_view except{};  ///< A part of the paths that the rule leaves out.
};

// The parts whose code runs on lanes, device threads and callers' real-time threads. registry/ and
// gvd/ are in it because their servants are what lanes run.
const std::vector<std::string_view>& realtime_folders() {
  static const std::vector<std::string_view> kFolders{
      "protocol/", "runtime/rt/", "runtime/transport/", "runtime/rpc/", "gvd/", "devices/sim/"};
  return kFolders;
}

// Patterns of words that match themselves are cut in two, so that this file does not break the
// rules that it states.
const std::vector<Rule>& rules() {
  static const std::vector<Rule> kRules{
      {"mutex", std::regex(R"(std::(recursive_|shared_|timed_)*mutex|std::condition_variable)"),
       Reads::kCode, realtime_folders(),
       "it does not inherit priority; pass values by Latest, SpscRing or an rt mutex"},
      {"sleep", std::regex(R"(\b(sleep_for|usleep|nanosleep|sched_yield|this_thread::yield)\b)"),
       Reads::kCode, realtime_folders(),
       "wait for what is to come, or for an absolute time with rt::sleep_until"},
      {"wall-clock",
       std::regex(R"(\b(system_clock|high_resolution_clock|gettimeofday)\b)"),
       Reads::kCode,
       {},
       "it jumps; use the monotonic time of rt::now()"},
      {"clock",
       std::regex(R"(\bsteady_clock\b|\bclock_gettime\b)"),
       Reads::kCode,
       {"protocol/", "gvd/driver/"},
       "time is an argument here"},
      {"print", std::regex(R"(\b(v?f?printf|f?puts|std::cout|std::cerr|std::clog)\b)"),
       Reads::kCode, realtime_folders(), "count it, or give it back as a value"},
      {"stderr",
       std::regex(R"(\bstderr\b|std::(cerr|clog)\b)"),
       Reads::kCode,
       {"runtime/program/", "runtime/options/", "registry/", "gvd/", "clients/", "devices/"},
       "print by rt::print_error() or rt::Log, which escape the text of others"},
      {"json",
       std::regex(R"(\b[Jj]son::(parse|accept|sax_parse)\()"),
       Reads::kCode,
       {"protocol/", "runtime/", "registry/", "schema/", "gvd/", "devices/", "clients/"},
       "its recursion is as deep as the text of others; use parse_bounded_json()"},
      {"system",
       std::regex("\\b(_WIN"
                  "(32|64)|__APPLE__|__linux__|__MINGW(32|64)__)\\b|"
                  "#include <(windows|winsock2|ws2tcpip|aclapi|sddl|io)\\.h>"),
       Reads::kCode,
       {"protocol/", "runtime/", "registry/", "schema/", "gvd/", "devices/", "clients/", "tests/"},
       "an operating system has a folder of its own, os/<system>/, which CMake chooses",
       "/os/"},
      {"compiler",
       std::regex(R"(__asm__|__builtin_|__attribute__|__GXX_)"),
       Reads::kCode,
       {"protocol/", "runtime/access/", "runtime/program/", "runtime/options/", "registry/",
        "gvd/"},
       "other compilers have other words; give base/compiler.hpp a function for it",
       "/compiler.hpp"},
      {"throw", std::regex(R"(\bthrow\b)"), Reads::kCode, {}, "errors are values: expected<T, E>"},
      {"function", std::regex(R"(\bstd::function\b)"), Reads::kCode, realtime_folders(),
       "it may allocate; take a template, a reference or an interface"},
      {"atomic-wait",
       std::regex(R"((\.|->)notify_(one|all)\()"),
       Reads::kCode,
       {"protocol/", "runtime/transport/", "runtime/rpc/"},
       "std::atomic::wait does not work across processes; use a futex or an eventfd"},
      {"deferred",
       std::regex("\\b(TO"
                  "DO|FIX"
                  "ME|XX"
                  "X|HA"
                  "CK)\\b"),
       Reads::kEverything,
       {},
       "finish it, or leave it out"},
      {"machine-path",
       std::regex("(^|[^A-Za-z0-9_.])/(ro"
                  "ot|ho"
                  "me|wo"
                  "rk)/|\\.\\./sha"
                  "red"),
       Reads::kEverything,
       {},
       "a path of one machine has no place in the project"},
  };
  return kRules;
}

bool is_in(const SourceFile& file, const std::vector<std::string_view>& folders) {
  return folders.empty() ||
         std::any_of(folders.begin(), folders.end(),
                     [&](std::string_view folder) { return file.path.starts_with(folder); });
}

constexpr std::string_view kListName = "CMakeLists.txt";

/// Whether a CMakeLists.txt above adds the folder of this one, "" being the root's.
bool is_added_by_cmake(const SourceFile& list, const std::vector<SourceFile>& files) {
  const std::string folder = list.path.substr(0, list.path.size() - kListName.size());
  return folder.empty() || std::any_of(files.begin(), files.end(), [&](const SourceFile& above) {
           if (!above.path.ends_with(kListName) || above.path == list.path) return false;
           const std::size_t size = above.path.size() - kListName.size();
           if (!folder.starts_with(above.path.substr(0, size))) return false;
           const std::string rest = folder.substr(size, folder.size() - size - 1);
           // Or a project of its own that a test builds.
           return above.text.find("add_subdirectory(" + rest + ")") != std::string::npos ||
                  above.text.find("_SOURCE_DIR}/" + rest + "\"") != std::string::npos;
         });
}

/// Whether `text` of a CMakeLists.txt names the source at `path`, in full or by a variable and the
/// rest of its name: "${subject}_fuzz.cpp".
bool names_source(const std::string& text, const std::string& path) {
  if (text.find(path) != std::string::npos) return true;
  static const std::regex kByVariable(R"(\$\{\w+\}([\w./]*\.cpp))");
  for (std::sregex_iterator named(text.begin(), text.end(), kByVariable), end; named != end;
       ++named) {
    if (path.ends_with((*named)[1].str())) return true;
  }
  return false;
}

/// Whether the CMakeLists.txt of its folder, or of one above, names a source.
bool is_named_by_cmake(const SourceFile& file, const std::vector<SourceFile>& files) {
  return std::any_of(files.begin(), files.end(), [&](const SourceFile& list) {
    if (!list.path.ends_with(kListName)) return false;
    const std::string folder = list.path.substr(0, list.path.size() - kListName.size());
    return file.path.starts_with(folder) &&
           names_source(list.text, file.path.substr(folder.size()));
  });
}

void check_header(const SourceFile& file, std::vector<Fault>& faults) {
  if (!file.text.starts_with("#pragma once\n")) {
    faults.push_back(fault_at(file, 0, "a header begins with #pragma once"));
  }
  const std::vector<std::string> lines = lines_of(code_of(file.text));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].find("using namespace") != std::string::npos) {
      faults.push_back(
          fault_at(file, i, "`using namespace` in a header reaches all who include it"));
    }
  }
}

/// The end of the block that opens at `open`, or the text's end.
std::size_t end_of_block(std::string_view code, std::size_t open) {
  int depth = 0;
  for (std::size_t i = open; i < code.size(); ++i) {
    if (code[i] == '{') ++depth;
    if (code[i] == '}' && --depth == 0) return i;
  }
  return code.size();
}

}  // namespace

const std::vector<Exemption>& exemptions() {
  static const std::vector<Exemption> kExemptions{
      {"print", "protocol/base/src/assert.cpp", "prints the bug that ends the process"},
      {"print", "runtime/rt/src/cpu_latency.cpp", "the one warning that CPUs may sleep deeply"},
      {"print", "runtime/rt/src/log.cpp", "the log of programs, for threads that are time-shared"},
      {"print", "runtime/rt/src/memory.cpp", "the one warning that memory is not locked"},
      {"print", "runtime/rt/src/report.cpp", "warnings of threads that are no lanes'"},
      {"print", "runtime/rt/src/thread.cpp", "the one warning that a thread is time-shared"},
      {"stderr", "runtime/options/src/server_options.cpp", "the report of this program's set-up"},
      {"function", "runtime/rt/include/rtpm/rt/thread.hpp", "a thread's body, taken at set-up"},
      {"function", "runtime/rt/src/os/posix/pthread.cpp", "a thread's body, taken at set-up"},
      {"function", "runtime/rt/src/os/windows/thread.cpp", "a thread's body, taken at set-up"},
      {"sleep", "runtime/rt/src/os/portable/native_clock.cpp", "what rt::sleep_until is made of"},
      {"wall-clock", "runtime/rt/src/utc.cpp", "gives the wall clock's time"},
      {"json", "protocol/base/include/rtpm/base/nesting.hpp", "checks the nesting before"},
      {"mutex", "runtime/rt/include/rtpm/rt/parallel_jobs.hpp", "of time-shared threads"},
      {"mutex", "runtime/rt/src/parallel_jobs.cpp", "of time-shared threads"},
      {"function", "runtime/rt/include/rtpm/rt/parallel_jobs.hpp", "jobs of time-shared threads"},
      {"function", "runtime/rt/src/parallel_jobs.cpp", "jobs of time-shared threads"},
      {"function", "gvd/recording/file/include/rtpm/recording/file_reader.hpp", "reads files"},
      {"function", "gvd/recording/file/src/file_reader.cpp", "reads files"},
      {"function", "gvd/service/src/stop/stop_round.hpp",
       "of callers outside of a device's server"},
      {"stderr", "clients/rtpm/cli/context.cpp", "errors in JSON, escaped"},
      {"throw", "clients/python/src/errors.cpp", "how a Python exception is raised"},
      {"throw", "clients/rtpm/cli/command.cpp", "how CLI11 is told of a wrong value"},
      {"throw", "tests/interop/cpp/checks.cpp", "how a case ends at its first fault"},
      {"throw", "tests/system/plugins/stubborn.cpp", "a plug-in that misbehaves"},
      {"throw", "tests/unit/driver_host/plugins/plugin.cpp", "a plug-in that misbehaves"},
  };
  return kExemptions;
}

std::vector<Fault> find_banned_words(const std::vector<SourceFile>& files,
                                     const std::vector<Exemption>& excused) {
  std::vector<Fault> faults;
  std::set<std::pair<std::string_view, std::string_view>> used;
  for (const SourceFile& file : files) {
    const std::vector<std::string> text_lines = lines_of(file.text);
    const std::vector<std::string> code_lines =
        is_cpp(file) ? lines_of(code_of(file.text)) : std::vector<std::string>{};
    for (const Rule& rule : rules()) {
      if (!is_in(file, rule.folders)) continue;
      if (!rule.except.empty() && file.path.find(rule.except) != std::string::npos) continue;
      const auto& lines = rule.reads == Reads::kCode ? code_lines : text_lines;
      for (std::size_t i = 0; i < lines.size(); ++i) {
        std::smatch match;
        if (!std::regex_search(lines[i], match, rule.pattern)) continue;
        const auto exemption =
            std::find_if(excused.begin(), excused.end(), [&](const Exemption& candidate) {
              return candidate.rule == rule.name && candidate.path == file.path;
            });
        if (exemption != excused.end()) {
          used.emplace(exemption->rule, exemption->path);
          continue;
        }
        faults.push_back(fault_at(file, i,
                                  "'" + match.str() + "' (rule " + std::string(rule.name) +
                                      "): " + std::string(rule.remedy)));
      }
    }
  }
  for (const Exemption& exemption : excused) {
    if (!used.contains({exemption.rule, exemption.path})) {
      faults.push_back(std::string(exemption.path) + ": is exempt from rule " +
                       std::string(exemption.rule) +
                       " but does not break it; take the exemption away");
    }
  }
  return faults;
}

std::vector<Fault> find_misshapen_files(const std::vector<SourceFile>& files) {
  std::vector<Fault> faults;
  for (const SourceFile& file : files) {
    if (file.path.ends_with(kListName) && !is_added_by_cmake(file, files)) {
      faults.push_back(fault_at(file, 0, "no CMakeLists.txt above adds this folder"));
    }
    if (!is_cpp(file)) continue;
    const std::size_t line_count = lines_of(file.text).size();
    if (line_count > kFileLineMax) {
      faults.push_back(
          fault_at(file, line_count - 1, "more than 800 lines: more than one subject"));
    }
    if (file.path.ends_with(".cpp")) {
      if (!is_named_by_cmake(file, files)) {
        faults.push_back(fault_at(file, 0, "no CMakeLists.txt names this source"));
      }
    } else {
      check_header(file, faults);
    }
  }
  return faults;
}

std::vector<Fault> find_empty_tests(const std::vector<SourceFile>& files) {
  static const std::regex kTest(R"(\b(TYPED_)?TEST(_F|_P)?\(\s*\w+,\s*\w+\s*\)\s*\{)");
  static const std::regex kAsserts(
      R"(\b(EXPECT_\w+|ASSERT_\w+|FAIL|ADD_FAILURE\w*|static_assert|(expect|assert|check)_\w+)\s*[(<])");
  std::vector<Fault> faults;
  for (const SourceFile& file : files) {
    if (!file.path.starts_with("tests/") || !is_cpp(file)) continue;
    const std::string code = code_of(file.text);
    for (std::sregex_iterator test(code.begin(), code.end(), kTest), end; test != end; ++test) {
      const auto begin = static_cast<std::size_t>(test->position());
      const std::size_t open = begin + static_cast<std::size_t>(test->length()) - 1;
      const std::string body = code.substr(open, end_of_block(code, open) - open);
      if (!std::regex_search(body, kAsserts)) {
        const auto line = std::count(code.begin(), code.begin() + test->position(), '\n');
        faults.push_back(
            fault_at(file, static_cast<std::size_t>(line), "this test asserts nothing"));
      }
    }
  }
  return faults;
}

}  // namespace rtpm::tidy
