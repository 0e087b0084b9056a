#include "host/finding_text.hpp"

#include <algorithm>
#include <array>
#include <sstream>

#include "cli/table.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

constexpr std::array<Severity, 4> kWorstFirst{Severity::kProblem, Severity::kWarning,
                                              Severity::kNote, Severity::kGood};
constexpr std::size_t kIndent = 9;  // The width of the severity.
constexpr std::size_t kLabel = 8;   // The width of "remedy".

Colour colour_of(Severity severity) {
  switch (severity) {
    case Severity::kProblem:
      return Colour::kRed;
    case Severity::kWarning:
      return Colour::kYellow;
    case Severity::kGood:
      return Colour::kGreen;
    case Severity::kNote:
      break;
  }
  return Colour::kBold;
}

std::string padded(std::string_view text, std::size_t width) {
  return std::string(text) + std::string(width - std::min(width, text.size()), ' ');
}

std::string label(const char* name) {
  return std::string(kIndent, ' ') + coloured(padded(name, kLabel), Colour::kGrey);
}

/// Prints a shell line unwrapped, so that it can be pasted.
std::string remedy_text(const std::string& remedy, std::size_t width) {
  std::string text;
  std::istringstream lines(remedy);
  for (std::string line; std::getline(lines, line);) {
    const std::string head = text.empty() ? label("remedy") : std::string(kIndent + kLabel, ' ');
    const bool is_command = line.find("sudo ") != std::string::npos;
    text += is_command ? head + line + "\n" : hanging(head, kIndent + kLabel, line, width);
  }
  return text;
}

std::string text_of(const Finding& finding, std::size_t width) {
  const std::string severity = padded(to_string(finding.severity), kIndent);
  std::string text = hanging(coloured(severity, colour_of(finding.severity)), kIndent,
                             finding.id + ": " + printable(finding.text, kShownWhole), width);
  if (!finding.cost.empty()) {
    text += hanging(label("cost"), kIndent + kLabel, printable(finding.cost, kShownWhole), width);
  }
  return text + remedy_text(printable_lines(finding.remedy, kShownWhole), width);
}

std::size_t count_of(const std::vector<Finding>& findings, Severity severity) {
  return static_cast<std::size_t>(std::ranges::count(findings, severity, &Finding::severity));
}

std::string counts_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Severity severity : kWorstFirst) {
    const std::size_t count = count_of(findings, severity);
    const bool is_plural = count != 1 && severity != Severity::kGood;
    text += (text.empty() ? "" : ", ") + std::to_string(count) + " " +
            std::string(to_string(severity)) + (is_plural ? "s" : "");
  }
  return text + "\n";
}

}  // namespace

std::string text_of(const std::vector<Finding>& findings, bool shows_all, std::size_t width) {
  std::string text = counts_of(findings) + "\n";
  std::string good;
  for (const Severity severity : kWorstFirst) {
    for (const Finding& finding : findings) {
      if (finding.severity != severity) continue;
      if (severity == Severity::kGood && !shows_all) {
        good += (good.empty() ? "" : ", ") + finding.id;
        continue;
      }
      text += text_of(finding, width);
      if (severity != Severity::kGood) text += "\n";
    }
  }
  if (good.empty()) return text;
  return text + hanging(coloured(padded("good", kIndent), Colour::kGreen), kIndent, good, width);
}

std::string text_of_changes(const FindingReport& report) {
  if (report.changes.empty()) return "nothing to fix\n";
  std::string text;
  for (const rt::Change& change : report.changes) {
    const bool is_made = change.problem.empty();
    const char* const verb = !is_made        ? "not changed  "
                             : report.is_dry ? "would change "
                                             : "changed      ";
    text += coloured(verb, is_made ? Colour::kGreen : Colour::kRed) + change.path + " from " +
            printable(change.from) + " to " + change.to +
            (is_made ? "" : ": " + printable(change.problem)) + "\n";
  }
  if (!report.lastings.empty()) text += "until the host starts anew; to make it last:\n";
  for (const std::string& line : report.lastings)
    text += "  " + line + "\n";
  return text;
}

Json json_of_findings(const FindingReport& report) {
  Json list = Json::array();
  for (const Finding& finding : report.findings) {
    list.push_back(
        {{"id", finding.id},
         {"severity", to_string(finding.severity)},
         {"finding", finding.text},
         {"cost", finding.cost},
         {"remedy", finding.remedy},
         {"fixable", finding.is_fixable()},
         {"fixed", std::ranges::find(report.fixed_ids, finding.id) != report.fixed_ids.end()}});
    if (!finding.lasting.empty()) list.back()["lasting"] = finding.lasting;
  }
  return list;
}

Json json_of_changes(const FindingReport& report) {
  Json list = Json::array();
  for (const rt::Change& change : report.changes) {
    Json json{{"path", change.path},
              {"from", change.from},
              {"to", change.to},
              {"is_made", change.problem.empty() && !report.is_dry}};
    if (!change.problem.empty()) json["problem"] = change.problem;
    list.push_back(std::move(json));
  }
  return list;
}

}  // namespace rtpm::tool
