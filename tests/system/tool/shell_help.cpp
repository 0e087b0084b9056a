#include "shell_help.hpp"

#include <sstream>

#include "programs.hpp"

namespace rtpm::system_test {

std::vector<std::string> commands_below(const std::string& path) {
  std::vector<std::string> arguments;
  std::istringstream words(path);
  for (std::string word; words >> word;)
    arguments.push_back(word);
  arguments.emplace_back("--help");
  const auto end = run_program("rtpm", arguments);
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  const std::size_t begin = end.output.find("\nCommands:\n");
  std::vector<std::string> commands;
  if (begin == std::string::npos) return commands;
  std::istringstream lines(end.output.substr(begin + 11));
  for (std::string line; std::getline(lines, line) && line.starts_with("  ");) {
    if (line[2] == ' ') continue;
    const std::string name = line.substr(2, line.find(' ', 2) - 2);
    commands.push_back(path.empty() ? name : path + " " + name);
    for (std::string& below : commands_below(commands.back()))
      commands.push_back(std::move(below));
  }
  return commands;
}

}  // namespace rtpm::system_test
