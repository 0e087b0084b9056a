#include "laboratory/status_table.hpp"

#include <chrono>
#include <sstream>

#include "cli/table.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/options/formatted.hpp"

namespace rtpm::tool {

using laboratory::State;

Colour colour_of(State state) {
  switch (state) {
    case State::kServing:
    case State::kDone:
      return Colour::kGreen;
    case State::kFailed:
      return Colour::kRed;
    case State::kStarting:
    case State::kPausing:
    case State::kStopping:
      return Colour::kYellow;
    case State::kWaiting:
    case State::kEnded:
      break;
  }
  return Colour::kGrey;
}

std::string span_text(Duration span) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(span).count();
  if (seconds < 10)
    return options::formatted("%.1f s", std::chrono::duration<double>(span).count());
  if (seconds < 60) return std::to_string(seconds) + " s";
  if (seconds < 3600)
    return std::to_string(seconds / 60) + " min " + std::to_string(seconds % 60) + " s";
  return std::to_string(seconds / 3600) + " h " + std::to_string(seconds / 60 % 60) + " min";
}

std::string clipped(const std::string& text, std::size_t width) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = (static_cast<unsigned char>(text[i]) & 0xc0) != 0x80;
    if (begins && ++count > width) return text.substr(0, i);
  }
  return text;
}

std::vector<std::string> status_table(const laboratory::Plan& plan,
                                      const laboratory::Supervision& supervision, MonotonicTime now,
                                      std::size_t width) {
  std::vector<Row> rows{{"PROGRAM", "STATE", "PROCESS", "FOR", "RESTARTS", ""}};
  for (const std::size_t program : plan.order) {
    const auto& status = supervision.status(program);
    rows.push_back({plan.programs[program].name, std::string(to_string(status.state)),
                    status.process > 0 ? std::to_string(status.process) : "-",
                    span_text(now - status.since), std::to_string(status.restart_count),
                    printable(status.note.empty() ? status.url : status.note)});
  }
  // The last column is flush left, after columns that are flush right.
  std::vector<std::string> notes;
  for (Row& row : rows) {
    notes.push_back(std::move(row.back()));
    row.pop_back();
  }
  std::istringstream lines(aligned(rows, 2));
  std::vector<std::string> table;
  for (std::string line; std::getline(lines, line);) {
    const std::string& note = notes[table.size()];
    if (!note.empty()) line += "  " + note;
    table.push_back(width == 0 ? line : clipped(line, width));
  }
  const std::size_t begin = table.front().find("STATE");
  table.front() = coloured(table.front(), Colour::kBold);
  for (std::size_t i = 1; i < table.size(); ++i) {
    const State state = supervision.status(plan.order[i - 1]).state;
    const std::string word(to_string(state));
    if (table[i].compare(begin, word.size(), word) == 0)
      table[i].replace(begin, word.size(), coloured(word, colour_of(state)));
  }
  return table;
}

}  // namespace rtpm::tool
